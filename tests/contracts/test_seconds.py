"""Seconds of test files: summed by file, the slowest first, with its slowest test."""

from benchmarks.seconds import FileSeconds, files_of, table

REPORT = """<?xml version="1.0"?><testsuites><testsuite>
<testcase classname="tests.gates.test_a" name="test_one[x]" time="0.5"/>
<testcase classname="tests.gates.test_b" name="test_two" time="2.0"/>
<testcase classname="tests.gates.test_b" name="test_three" time="1.0"><failure/></testcase>
</testsuite></testsuites>"""


def test_tests_are_summed_by_file_whatever_came_of_them(tmp_path):
    file = tmp_path / "report.xml"
    file.write_text(REPORT)
    found = files_of(file)
    assert found == [
        FileSeconds("tests.gates.test_b", 2, 3.0, "test_two", 2.0),
        FileSeconds("tests.gates.test_a", 1, 0.5, "test_one[x]", 0.5),
    ]
    heads, _, slowest, fastest, total = table(found)
    assert heads == "| file | tests | s | s a test | slowest test | s |"
    assert slowest == "| tests.gates.test_b | 2 | 3.0 | 1.50 | test_two | 2.0 |"
    assert fastest.startswith("| tests.gates.test_a | 1 | 0.5 |")
    assert total == "| 2 files | 3 | 3.5 | | | |"
