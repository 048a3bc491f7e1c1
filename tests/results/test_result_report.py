"""The report is one file that asks nobody for anything, and lets no text become markup."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from made_results import make_result

from rds.core.errors import InputError
from rds.core.figure import Picture
from rds.modes.experiment.report import save_with_report
from rds.results import Result, write_report
from rds.results.report import page

HOSTILE = "<script>alert('x')</script>\"><img src=http://evil.example/x onerror=alert(1)>{title}"


class Page(HTMLParser):
    """Tags, attributes and balance of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def report(tmp_path: Path, results: list[Result], **more: object) -> tuple[str, Page]:
    path = write_report(tmp_path / "report.html", "Three axes", results, **more)  # type: ignore[arg-type]
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert not page.open
    return text, page


def test_a_plot_that_is_drawn_is_the_reports_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    png, pictures = Picture.png, []
    monkeypatch.setattr(Picture, "png", lambda self: pictures.append(png(self)) or pictures[-1])  # type: ignore[func-returns-value]
    files = save_with_report(make_result("simulation", "X", seconds=0.5), tmp_path, "one axis")
    assert pictures == [files["plot_X"].read_bytes()]
    shown = Page(files["report"].read_text(encoding="utf-8"))
    assert [attrs["src"] for tag, attrs in shown.tags if tag == "img"] == [
        f"data:image/png;base64,{base64.b64encode(pictures[0]).decode()}"
    ]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Page]:
    """A report that has all that a report may have."""
    folder = tmp_path_factory.mktemp("whole")
    results = [make_result(mode, "XY", seconds=6.0) for mode in ("simulation", "emulation", "implementation")]
    tables = [{"title": "Table 2", "columns": ["axis", "paper", "ours"], "rows": [["X", 1.5, None]], "note": "a note"}]
    return report(folder, results, tables=tables, notes=["five mm"], files=[folder / "a b" / "result.csv"])


def test_the_report_holds_runs_metrics_verdicts_tables_pictures_files(whole: tuple[str, Page]) -> None:
    text, page = whole
    for said in ("Three axes", "five mm", "Table 2", "a note", "Axis Y", "RMS error [mm]", "fit [%]", "fifo", "–"):
        assert said in page.text, said
    assert page.text.count("within their period") == 2
    pictures = [attrs["src"] or "" for tag, attrs in page.tags if tag == "img"]
    assert len(pictures) == 1 + 3 + 2
    assert all(base64.b64decode(p.removeprefix("data:image/png;base64,")).startswith(b"\x89PNG") for p in pictures)
    assert [a["href"] for tag, a in page.tags if tag == "a"] == ["./a%20b/result.csv"]
    assert "prefers-color-scheme: dark" in text


def test_the_report_refers_to_nothing_outside(whole: tuple[str, Page]) -> None:
    text, page = whole
    text = re.sub(r"base64,[\w+/=]*", "", text)  # letters by chance
    assert not re.search(r"https?:|//\w+\.|url\(|@import|<link|<script", text)
    assert "http:" not in text and "https:" not in text
    assert all(not (a.get("src") or "data:").startswith(("http", "//", "/", "file:")) for _, a in page.tags)


def test_hostile_text_stays_text(tmp_path: Path) -> None:
    bad = make_result(
        "implementation",
        seconds=1.0,
        machine=HOSTILE,
        verdict=HOSTILE,
        verdict_reason=HOSTILE,
        ending=HOSTILE,
        started=HOSTILE,
        environment={HOSTILE: HOSTILE},
        controller={"X": {"name": HOSTILE, "params": {HOSTILE: [HOSTILE]}}},
        model=HOSTILE,
        versions={HOSTILE: HOSTILE},
        timing={HOSTILE: {"p50": HOSTILE}},
    )
    odd = Result({"time": [0.0, 1.0], f"{HOSTILE}_measured": [0.0, 1.0]}, meta={"axes": [HOSTILE], "sample_period": 1})
    table = {"title": HOSTILE, "columns": [HOSTILE], "rows": [[HOSTILE]], "note": HOSTILE}
    path = write_report(tmp_path / "r.html", HOSTILE, [bad, odd], [table], [HOSTILE], [tmp_path / "javascript:x<b>"])
    page = Page(path.read_text(encoding="utf-8"))
    assert not page.open
    assert "script" not in {tag for tag, _ in page.tags}
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    assert all((a["src"] or "").startswith("data:image/png;base64,") for tag, a in page.tags if tag == "img")
    assert [a["href"] for tag, a in page.tags if tag == "a"] == ["./javascript%3Ax%3Cb%3E"]
    assert "<script" not in bad._repr_html_() and "<script" not in odd._repr_html_()


def test_runs_of_one_mode_are_numbered(tmp_path: Path) -> None:
    _, page = report(tmp_path, [make_result(seconds=0.1), make_result(seconds=0.1)])
    assert "simulation 1" in page.text and "simulation 2" in page.text


def test_an_empty_run_is_reported_too(tmp_path: Path) -> None:
    """A run that was stopped before its first sample still has a verdict and an environment to show."""
    _, page = report(tmp_path, [make_result("implementation", seconds=0.0, ending="fault")])
    assert "fault" in page.text


def test_what_cannot_be_reported_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least one result"):
        write_report(tmp_path / "r.html", "", [])
    with pytest.raises(InputError, match="lacks 'columns'"):
        write_report(tmp_path / "r.html", "", [make_result(seconds=0.1)], [{"title": "t", "rows": []}])
    assert not list(tmp_path.iterdir())


def test_a_page_of_any_kind_escapes_its_title_and_keeps_its_body() -> None:
    text = page(HOSTILE, "<p>as it is</p>")
    seen = Page(text)
    assert not seen.open and "<p>as it is</p>" in text
    assert "script" not in {tag for tag, _ in seen.tags} and HOSTILE in seen.text
    assert "default-src 'none'" in text


def test_a_number_of_five_digits_is_written_out() -> None:
    from rds.results.html import number

    assert [number(value) for value in (9.6e-7, 0.0123456, 10070.4, -12345.6, 3.2e9)] == [
        "9.6e-07", "0.01235", "10070", "-12346", "3.2e+09"
    ]  # fmt: skip
