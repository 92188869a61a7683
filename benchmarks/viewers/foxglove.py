"""Foxglove's own viewer, as far as it was open, on a file of ours: what it lists, says and shows.

The npm package `@foxglove/studio-base` (1.48.0, MPL-2.0) holds the whole application, built. It is
served beside the file from this machine alone and opened in Chromium, with the layout that was
written beside the file. Nothing is downloaded here: `docs/viewers.md` says what to install first.
"""

import json
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote

from benchmarks.viewers.browser import Page, opened

SETTLED_S = 8.0
"""After the file is open: drawn by the processor, a picture comes late."""
PARTS = (
    "@foxglove/studio-base/assets",
    "react/umd/react.production.min.js",
    "react-dom/umd/react-dom.production.min.js",
)
"""What of the installed packages is served."""
PAGE = """<!DOCTYPE html><meta charset="utf-8"><style>html,body,#root{height:100%;margin:0}
#root{display:flex;flex-direction:column;position:relative;overflow:hidden}</style>
<div id="root"></div><script>
const said = []
addEventListener('error', (one) => said.push(`uncaught: ${one.message}`))
addEventListener('unhandledrejection', (one) => said.push(`rejected: ${one.reason}`))
for (const kind of ['error', 'warn']) {
  const print = console[kind]
  console[kind] = (...words) => {
    said.push(`${kind}: ${words.map((one) => one?.message ?? String(one)).join(' ')}`)
    print.apply(console, words)
  }
}
</script><script src="react.production.min.js"></script>
<script src="react-dom.production.min.js"></script>
<script>self.react = React; self['react-dom'] = ReactDOM</script>
<script src="assets/index.js"></script><script>
const start = async () => {
  const kept = new Map([['colorScheme', 'light']])
  const appConfiguration = {
    get: (key) => kept.get(key), set: async (key, value) => { kept.set(key, value) },
    addChangeListener() {}, removeChangeListener() {},
  }
  const data = await (await fetch('layout.json')).json()
  const layout = {
    id: 'ours', name: 'ours', permission: 'CREATOR_WRITE', baseline: { data, savedAt: undefined },
  }
  const layouts = new Map([[layout.id, layout]])
  const layoutStorage = {
    list: async () => [...layouts.values()], get: async (_, id) => layouts.get(id),
    put: async (_, one) => { layouts.set(one.id, one); return one },
    delete: async (_, id) => { layouts.delete(id) }, importLayouts: async () => {},
  }
  await initI18n()
  ReactDOM.render(React.createElement(App, {
    appConfiguration, layoutStorage, dataSources: [new RemoteDataSourceFactory()],
    extensionLoaders: [], deepLinks: [location.href], enableGlobalCss: true,
  }), document.getElementById('root'))
}
start().catch((fault) => said.push(`start: ${fault.stack}`))
</script>"""
SHOWN = "document.body.innerText"
TAB = """[...document.querySelectorAll('[role=tab]')]
.find((one) => one.textContent.startsWith('%s'))?.click()"""


@dataclass(frozen=True)
class Seen:
    """What the viewer made of a file.

    Attributes:
        text: All words on the screen, the list of topics among them.
        problems: Words of its list of problems.
        said: Errors and warnings that it printed, faults that nobody caught.
    """

    text: str
    problems: str
    said: tuple[str, ...]


class _Ranged(SimpleHTTPRequestHandler):
    """Files of a folder, also in parts: the viewer asks for no file as a whole."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *_: object) -> None:
        """Print nothing."""

    def end_headers(self) -> None:
        self.send_header("Accept-Ranges", "bytes")
        super().end_headers()

    def do_GET(self) -> None:
        asked = self.headers.get("Range")
        if asked is None:
            super().do_GET()
            return
        held = Path(self.translate_path(self.path)).read_bytes()
        first, _, last = asked.removeprefix("bytes=").partition("-")
        part = held[int(first) : int(last or len(held)) + 1]
        self.send_response(206)
        end = int(first) + len(part) - 1
        self.send_header("Content-Range", f"bytes {first}-{end}/{len(held)}")
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)


def seen(modules: Path, file: Path, layout: Path, *, at_s: Sequence[float], pictures: Path) -> Seen:
    """Open a file in the viewer, once for each moment.

    Args:
        modules: Folder `node_modules` with what is named in `PARTS`.
        file: MCAP, from 0 s on.
        layout: Beside it.
        at_s: Moments, from the start, s.
        pictures: Folder for a PNG of each.

    Returns:
        Of the first moment.

    Raises:
        FileNotFoundError: A package is missing.
        RuntimeError: No browser, or the viewer does not start.
    """
    found = []
    with _served(modules, file, layout) as address:
        for moment in at_s:
            stamp = f"1970-01-01T00:00:{moment:012.9f}Z"
            source = f"ds=remote-file&ds.url={quote(f'{address}/file.mcap', safe='')}"
            where = f"{address}/index.html?{source}&layoutId=ours&time={quote(stamp)}"
            with opened(where) as page:
                found.append(_read(page))
                page.picture(pictures / f"{file.stem}.{moment:g}s.png")
    return found[0]


def _read(page: Page) -> Seen:
    page.wait(f"/duration\\s+\\d/i.test({SHOWN})")
    time.sleep(SETTLED_S)
    text = page.value(SHOWN)
    page.value(TAB % "Problems")
    time.sleep(1.0)
    problems = page.value(SHOWN)
    page.value(TAB % "Topics")
    return Seen(text, problems, tuple(page.value("said")))


@contextmanager
def _served(modules: Path, file: Path, layout: Path) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in PARTS:
            (folder / Path(part).name).symlink_to((modules / part).resolve(strict=True))
        (folder / "index.html").write_text(PAGE, encoding="utf-8")
        shutil.copyfile(file, folder / "file.mcap")
        (folder / "layout.json").write_text(json.dumps(json.loads(layout.read_text())))
        server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Ranged, directory=name))
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            server.server_close()
