"""A generated form in a browser: a file chosen, refusals told, a result that is led to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from serving import serving, watching
from web_shop import fill, write_files

HEAD = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg\n"


def test_a_form_sends_its_files_and_leads_to_the_result(
    kernels: None, browser: Any, tmp_path: Path
) -> None:
    write_files(tmp_path)
    fill(tmp_path / "shop", tmp_path).workspace.close()
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    good.write_text(HEAD + "0,-90,90,0,0,0\n")
    bad.write_text(HEAD + "0,-90,x,0,0,0\n")
    with serving(tmp_path / "shop") as served, watching(browser, served) as watched:
        page = watched.page
        page.goto("/tools")
        page.locator('a[href="/tools/predict"]').click()
        watched.find("file-queries").set_input_files(str(bad))
        watched.find("run").click()
        fault = watched.find("job-fault")  # the page comes again with what the job failed with
        fault.wait_for()
        assert "bad.csv:2: column 'j3_deg' is 'x'" in fault.inner_text()
        watched.find("run").click()
        refused = watched.find("refused")
        refused.wait_for()
        assert "a file." in refused.inner_text()
        assert watched.faults == [
            "Failed to load resource: the server responded with a status of 400 (Bad Request)"
        ]
        watched.faults.clear()
        watched.find("file-queries").set_input_files(str(good))
        page.locator("input[name=output]").fill("errors.csv")
        watched.find("run").click()
        watched.find("result-files").wait_for()
        assert "errors.csv" in watched.find("result-files").inner_text()
        assert "SIMULATED" in watched.find("block-note").inner_text()
        with page.expect_download() as downloaded:
            page.get_by_text("errors.csv", exact=True).click()
        assert Path(downloaded.value.path()).read_text().startswith("# robotrue SIMULATED")
        watched.find("change").click()
        kept = watched.find("kept-queries")
        kept.wait_for()
        assert "good.csv" in kept.locator("option:checked").inner_text()
        for place in (page.url, "/tools/transfer"):
            page.goto(place)
            for width in (1440, 1180, 390):
                page.set_viewport_size({"width": width, "height": 844})
                sheet = page.locator("#sheet")
                assert sheet.evaluate("s => s.scrollWidth <= s.clientWidth"), (place, width)
