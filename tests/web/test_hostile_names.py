"""Fifty names and notes that are scripts, in a real browser: shown as text, none of them runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from serving import serving, watching
from web_shop import fill, write_files

from robotrue.store import cells, items, measurements, programs
from robotrue.store.nouns import CELL, MEASUREMENT, MODEL, PROGRAM
from robotrue.store.records import ItemQuery

RAN: Final = "window.__ran=1"
PAGES: Final = (
    "/", "/plan", "/measurements", "/calibration", "/registration", "/programs", "/drift",
    "/drilling", "/live", "/tools", "/tools/predict", "/tools/diff", "/history",
)  # fmt: skip
SCRIPTS: Final = (
    f"<script>{RAN}</script>",
    f"</script><script>{RAN}</script>",
    f"</textarea><script>{RAN}</script>",
    f"</title><script>{RAN}</script>",
    f"</style><script>{RAN}</script>",
    f"<img src=x onerror={RAN}>",
    f'"><img src=x onerror="{RAN}">',
    f"'><img src=x onerror='{RAN}'>",
    f"<svg onload={RAN}>",
    f"<svg><script>{RAN}</script></svg>",
    f"<body onload={RAN}>",
    "<iframe srcdoc='<script>parent.__ran=1</script>'>",
    "<iframe src=javascript:parent.__ran=1>",
    f"<a href=javascript:{RAN} autofocus onfocus={RAN}>x</a>",
    f'" autofocus onfocus="{RAN}" x="',
    f"' autofocus onfocus='{RAN}' x='",
    f'" onmouseover="{RAN}" style="position:fixed;inset:0',
    f"<input autofocus onfocus={RAN}>",
    f"<details open ontoggle={RAN}>x</details>",
    f"<video><source onerror={RAN}></video>",
    f"<audio src=x onerror={RAN}>",
    f"<math><mtext><img src=x onerror={RAN}></mtext></math>",
    f"<object data=javascript:{RAN}>",
    f"<embed src=javascript:{RAN}>",
    f"<meta http-equiv=refresh content='0;url=javascript:{RAN}'>",
    "<link rel=stylesheet href=http://stranger.example/x.css>",
    "<img src=http://stranger.example/x.png>",
    "<base href=http://stranger.example/>",
    "<form action=http://stranger.example/><button autofocus>x</button></form>",
    f"{{{{ constructor.constructor('{RAN}')() }}}}",
    f"{{{{ $root.constructor.constructor('{RAN}')() }}}}",
    f"${{{RAN}}}",
    f"{{% raw %}}<script>{RAN}</script>{{% endraw %}}",
    f"';{RAN};//",
    f'";{RAN};//',
    f"`;{RAN};//",
    f"\\';{RAN};//",
    f"\\u003cscript\\u003e{RAN}\\u003c/script\\u003e",
    f"&lt;script&gt;{RAN}&lt;/script&gt;",
    f"&#60;img src=x onerror={RAN}&#62;",
    f"%3Cscript%3E{RAN}%3C/script%3E",
    f"javascript:{RAN}",
    "data:text/html,<script>parent.__ran=1</script>",
    f"[x](javascript:{RAN})",
    f"![x](x)<img src=x onerror={RAN}>",
    f"<!--><img src=x onerror={RAN}>-->",
    f"<![CDATA[><script>{RAN}</script>]]>",
    f"<<script>{RAN}//<</script>",
    f"<scr<script>ipt>{RAN}</scr</script>ipt>",
    f"<x style=animation-name:rotation onanimationstart={RAN}>",
)


def test_no_name_is_ever_run(browser: Any, tmp_path: Path) -> None:
    assert len(SCRIPTS) == 50
    write_files(tmp_path)
    shop = fill(tmp_path / "shop", tmp_path)
    with shop.workspace as workspace:
        rows = measurements.rows_of(workspace, shop.measured)
        for k, script in enumerate(SCRIPTS):
            if k % 3 == 0:
                programs.add(workspace, [tmp_path / "part.src"], name=script, note=script)
            elif k % 3 == 1:
                measurements.add(
                    workspace, rows, name=script, raw=[tmp_path / "simulated.csv"], note=script
                )
            else:
                cells.add(workspace, tmp_path / "cell.toml", name=script, note=script)
        for noun, each in (
            (MODEL, shop.model),
            (PROGRAM, shop.program),
            (MEASUREMENT, shop.measured),
            (CELL, shop.cell),
        ):
            items.change(workspace, noun, each.id, name="".join(SCRIPTS[:5]), note=SCRIPTS[5])
        addresses = [
            *PAGES,
            *(
                f"/programs?id={each.id}"
                for each in items.search(workspace, PROGRAM, ItemQuery(limit=4)).items
            ),
            f"/measurements?id={shop.measured.id}",
            f"/calibration?id={shop.model.id}",
            f"/?id={shop.cell.id}",
            *(f"/programs?id={script}" for script in SCRIPTS[:3]),
        ]
    with serving(tmp_path / "shop") as served, watching(browser, served) as watched:
        watched.provoked = ("status of 404",)
        page = watched.page
        page.on("dialog", lambda dialog: watched.faults.append(f"a dialog: {dialog.message}"))
        page.set_content(SCRIPTS[8])  # where nothing escapes it, it does run
        page.wait_for_function("window.__ran === 1")
        for address in addresses:
            page.goto(address)
            page.locator("#sheet").wait_for()
            page.wait_for_load_state("networkidle")
            assert page.evaluate("window.__ran") is None, address
        page.goto("/history")
        page.locator("#sheet").wait_for()
        shown = page.locator("#sheet").inner_text()
        assert SCRIPTS[-1] in shown  # as it was typed
