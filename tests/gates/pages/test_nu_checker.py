"""Pages of the gates and the desk, with clips and without anything, by the Nu HTML checker."""

import nu_checker

from gates.pages.page import gate_page, index_page
from gates.report import read_report
from gates.writing import write_gate


@nu_checker.asked
def test_the_nu_checker_says_nothing_of_any_page(ladder, tmp_path):
    write_gate(ladder, "E")
    pages = {gate: gate_page(ladder, read_report(ladder, gate)[0]) for gate in "ABCDE"}
    pages |= {"desk": index_page(ladder), "nothing": index_page(tmp_path)}
    assert "NOT JUDGED" in pages["nothing"]
    assert nu_checker.complaints(pages, tmp_path) == ""


@nu_checker.asked
def test_the_nu_checker_is_heard(tmp_path):
    page = '<!DOCTYPE html><html lang="en"><title>a</title><p id="a"><p id="a">'
    assert "Duplicate ID" in nu_checker.complaints({"wrong": page}, tmp_path)
