"""The page of a certificate: its numbers are those of the file, it never says more, and no name writes into it."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import holokin as hk
from conftest import Command, write_job
from holokin.app.report.proof_picture import proof_figure
from holokin.app.report.proof_report import save_with_page, write_page
from holokin.proof.recheck import CheckerWord, Outcome, ask_checker


@pytest.fixture(autouse=True)
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the page says is the statement, not what is drawn."""
    monkeypatch.setattr("holokin.app.report.proof_report.proof_figure", lambda _found: Figure(figsize=(1, 1)))


class Page(HTMLParser):
    """Tags, text and table rows of a page, by a parser of the standard library."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.words: list[str] = []
        self.rows: list[list[str]] = []
        self.cell = False
        self.text = file.read_text("utf-8")
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        assert not [name for name, value in attrs if name.startswith("on") or "javascript:" in (value or "")]
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
            self.cell = True

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1] not in ("style", "title"):
            self.words.append(data)
        if self.cell:
            self.rows[-1][-1] += data

    def handle_endtag(self, tag: str) -> None:
        self.tags.append(f"/{tag}")
        self.cell = self.cell and tag not in ("td", "th")

    @property
    def first(self) -> str:
        """The first line of what can be read."""
        return next(word for word in self.words if word.strip())

    def row(self, beginning: str) -> list[str]:
        return next(row for row in self.rows if row and row[0].startswith(beginning))


def planar(name: str = "planar-3r", joints: tuple[str, ...] = ("q1", "q2", "q3"), source: str = "a test") -> hk.Robot:
    arm = hk.load("planar-3r")
    named = [replace(c, name=n) for c, n in zip(arm.coordinates, joints, strict=True)]
    return replace(arm, name=name, source=source, coordinates=tuple(named))


def loop(arm: hk.Robot | None = None, constraint: str = "linear", limits: bool = True) -> hk.proof.Certificate:
    arm, q0 = arm or planar(), np.array([0.3, 0.9, 0.7])
    G = hk.holonomic(hk.position(arm), hk.linear([[0.3, 0, 1]], name=constraint))
    tool = arm.pose(q0)[:3, 3]
    return hk.certify(G, hk.circle(tool, center=tool - [0.1, 0, 0]), q0, limits=limits)


@cache
def elsewhere(limits: bool) -> hk.proof.Certificate:
    arm, q0 = planar(), np.array([-3.0, 0.9, 0.9])
    tool = arm.pose(q0)[:3, 3]
    G = hk.holonomic(hk.position(arm), hk.linear([[0.02, 0, 1]]))
    more = {"budget": 300} if limits else {}  # a joint limit ends the proof, however many boxes are looked at
    return hk.certify(G, hk.circle(tool, center=[0, 0, tool[2]]), q0, limits=limits, **more)


@cache
def box(budget: int = 20_000) -> hk.proof.Certificate:
    arm, q0 = planar(), np.array([0.3, 0.9, 0.9])
    G = hk.holonomic(hk.position(arm), hk.linear([[0, 1, -1]]))
    half = [0.3, 0.3, 0.0]
    return hk.certify(G, hk.workspace(box=(arm.pose(q0)[:3, 3], half)), q0, budget=budget)


@pytest.fixture(scope="module")
def whole() -> hk.proof.Certificate:
    return loop()


@pytest.fixture(scope="module")
def verified(whole: hk.proof.Certificate) -> CheckerWord:
    pytest.importorskip("flint")
    return ask_checker(whole)


def paged(found: hk.proof.Certificate, word: CheckerWord, folder: Path) -> Page:
    return Page(write_page(found, found.save(folder / "proof.json"), word))


def test_the_numbers_of_the_page_are_those_of_the_file_rounded_to_the_safe_side(
    whole: hk.proof.Certificate, verified: CheckerWord, tmp_path: Path
) -> None:
    page = paged(whole, verified, tmp_path)
    data = json.loads((tmp_path / "proof.json").read_text())
    least, low, high, most = data["claims"]["joints"]
    for i, name in enumerate(data["names"]):
        _, unit, *values, left = page.row(name)
        a, b, c, d = map(float, values)
        assert unit == data["units"][i]
        assert (a, d) == pytest.approx((least[i], most[i]), rel=1e-8)
        assert low[i] - 1.1e-8 <= b <= low[i] and high[i] <= c <= high[i] + 1.1e-8
        assert 0.99 <= float(left) / min(low[i] - least[i], most[i] - high[i]) <= 1
    determinant = float(page.row("|det")[1].rpartition(" ")[2])
    assert 0.99 <= determinant / data["claims"]["determinant"] <= 1
    assert f"|det [J; J_g]| >= {determinant:.3g}" in page.row("For every place")[0]
    gap = float(page.row("Gap")[1].rpartition(" ")[2])
    assert 1 <= gap / data["claims"]["gap"] <= 1.01
    cells = sum(text.count('"q0"') for text in [json.dumps(piece["cells"]) for piece in data["pieces"]])
    assert page.row("Cells")[1] == str(cells)
    assert page.row("Level c")[1] == f"[{data['level'][0]:.9g}]"
    posture = [float(part.split()[1]) for part in page.row("Posture")[1].split(", ")]
    assert posture == pytest.approx(data["pieces"][0]["q"], abs=1e-8)


def test_the_hash_of_the_page_is_that_of_the_file(
    whole: hk.proof.Certificate, verified: CheckerWord, tmp_path: Path
) -> None:
    page = paged(whole, verified, tmp_path)
    found = hashlib.sha256((tmp_path / "proof.json").read_bytes()).hexdigest()
    assert page.row("SHA-256")[1] == found
    assert f'content: "SHA-256 {found}"' in page.text  # at the foot of each sheet


def test_the_page_needs_nothing_but_itself_and_runs_no_script(
    whole: hk.proof.Certificate, verified: CheckerWord, tmp_path: Path
) -> None:
    page = paged(whole, verified, tmp_path)
    assert not {"script", "iframe", "link", "object", "a", "form", "base"} & set(page.tags)
    assert set(re.findall(r"(?:src|href)\s*=\s*['\"]?([^'\"\s>,;]*)", page.text)) == {"data:image/svg+xml"}
    assert "url(" not in page.text and "@import" not in page.text and "://" not in page.text
    assert "default-src 'none'" in page.text and "size: A4" in page.text


def test_a_loop_that_is_proven_and_verified_says_so_first(
    whole: hk.proof.Certificate, verified: CheckerWord, tmp_path: Path
) -> None:
    page = paged(whole, verified, tmp_path)
    assert page.first == "PROVEN: this closed path returns the joints to their start"
    assert verified.outcome is Outcome.VERIFIED and verified.compared
    assert page.row("At the end of the closed path")[1:] == ["proven", "verified"]
    assert page.row("Wherever else")[1:] == ["proven", "it does not look at this"]
    assert "python-flint" in page.row("Version")[1]


def test_what_the_checker_was_not_asked_is_not_called_verified(whole: hk.proof.Certificate, tmp_path: Path) -> None:
    page = Page(save_with_page(whole, tmp_path / "proof.json", seconds=0))
    assert page.first.startswith("PROVEN BUT NOT VERIFIED")
    assert "class='verdict good'" not in page.text
    assert {row[2] for row in page.rows if len(row) == 3} == {
        "Checker", "not verified", "it does not look at this", "not compared"
    }  # fmt: skip


def test_a_checker_that_is_out_of_time_has_verified_nothing(whole: hk.proof.Certificate, tmp_path: Path) -> None:
    pytest.importorskip("flint")
    page = Page(save_with_page(whole, tmp_path / "proof.json", seconds=1e-9))
    assert page.first.startswith("PROVEN BUT NOT VERIFIED")
    assert any("it is not verified within" in word for word in page.words)


def test_a_certificate_that_the_checker_rejects_is_said_to_fail(whole: hk.proof.Certificate, tmp_path: Path) -> None:
    pytest.importorskip("flint")
    false = replace(whole, determinant=1e3 * whole.determinant)
    page = Page(save_with_page(false, tmp_path / "proof.json"))
    assert page.first == "NOT VALID: the independent checker rejects this certificate"
    assert any("a determinant is less" in word for word in page.words)
    assert not [row for row in page.rows if len(row) == 3 and ("proven" in row[1:] or "verified" in row[1:])]
    assert "class='verdict good'" not in page.text


def test_what_the_checker_said_of_another_certificate_is_not_written(
    whole: hk.proof.Certificate, verified: CheckerWord, tmp_path: Path
) -> None:
    other = replace(whole, determinant=whole.determinant / 2)
    with pytest.raises(hk.base.errors.ArgumentError, match="this certificate"):
        write_page(other, other.save(tmp_path / "proof.json"), verified)
    with pytest.raises(hk.base.errors.ArgumentError, match=r"\.json"):
        save_with_page(whole, tmp_path / "proof.html")


def test_a_loop_that_ends_with_other_joints_says_so_first(tmp_path: Path) -> None:
    pytest.importorskip("flint")
    found = elsewhere(limits=False)
    page = Page(save_with_page(found, tmp_path / "proof.json"))
    assert page.first == "THE JOINTS DO NOT RETURN: this closed path ends with other joints"
    assert page.row("At the end of the closed path")[1:] == ["NO: they differ", "verified"]
    assert page.row("No joint leaves its limits")[1] == "NOT proven: not asked"
    assert any("Joint limits: the proof was made without them" in word for word in page.words)
    told = [float(x) for x in re.findall(r"[-\d.e]+(?= |$)", page.row("q1 differs by")[1].removesuffix(" rad"))]
    assert found.revisit is not None
    assert told == pytest.approx([found.revisit.low[0], found.revisit.high[0]], rel=1e-8)
    assert "class='verdict good'" not in page.text


def test_a_part_of_a_path_or_of_a_box_is_called_a_part_first(tmp_path: Path) -> None:
    part = elsewhere(limits=True)
    page = Page(save_with_page(part, tmp_path / "path.json", seconds=0))
    share = float(re.match(r"NOT ALL IS PROVEN: only ([\d.]+) % of the path", page.first)[1])  # type: ignore[index]
    assert 0 <= 100 * part.proven.boxes.high.max() - share <= 0.0101
    assert page.row("At the end of the closed path")[1] == "NOT proven"
    some = box(budget=20)
    assert not some.whole
    page = Page(save_with_page(some, tmp_path / "box.json", seconds=0))
    assert page.first.startswith("NOT") and "PROVEN:" not in page.first.replace("NOT ALL IS PROVEN:", "")


def test_a_certificate_without_a_cell_proves_nothing_and_its_page_says_so(tmp_path: Path) -> None:
    arm, q0 = hk.load("panda"), np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    tool = arm.pose(q0)[:3, 3]
    G = hk.holonomic(hk.pose(arm), hk.lock("panda_joint3"))
    none = hk.certify(G, hk.circle(tool, center=tool - [0.1, 0, 0]), q0, budget=1)
    page = Page(save_with_page(none, tmp_path / "proof.json"))
    assert (len(none), page.first) == (0, "NOTHING IS PROVEN")
    assert page.row("Anything")[1] == "NOT proven"
    assert not any(word in ("proven", "verified") for row in page.rows for word in row)


def test_a_box_that_is_proven_names_its_sides_and_its_orientation(tmp_path: Path) -> None:
    pytest.importorskip("flint")
    found = box()
    page = Page(save_with_page(found, tmp_path / "box.json"))
    assert page.first == "PROVEN: while the tool stays in this box, the same tool position has the same joints"
    given = json.loads((tmp_path / "box.json").read_text())["pieces"][0]["numbers"]
    told = [float(x) for x in re.findall(r"-?\d[\d.]*", page.row("Tool positions")[1])]
    center, half = np.array(given[:3]), np.array(given[12:15])
    assert told == pytest.approx(np.column_stack([center - half, center + half]).ravel(), rel=1e-5, abs=1e-6)
    assert page.row("Orientation")[1].startswith("free")
    assert page.row("Proven")[1] == "all of the box"


def test_the_picture_shows_the_path_that_was_asked_and_ends_where_the_proof_ends() -> None:
    part = elsewhere(limits=True)
    view = proof_figure(part).axes[1]
    tool = part.equation.strategy.task.robot.pose(part.anchors.q[0])[:2, 3]
    proven, rest, start = (np.array(line.get_data()).T for line in view.lines)
    assert np.linalg.norm(proven, axis=1) == pytest.approx(np.linalg.norm(tool), rel=1e-12)
    turn = 2 * np.pi * part.proven.boxes.high.max()
    end = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ tool
    assert proven[0] == pytest.approx(tool) == start[0]
    assert proven[-1] == pytest.approx(end) == rest[0]


HOSTILE = "<script>alert(1)</script>'\"><img src=x onerror=alert(1)>\u202e"
"""A name of somebody who does not mean well: a script, an end of attributes, letters from right to left."""


def test_no_name_of_a_robot_a_joint_a_source_or_a_strategy_writes_into_the_page(tmp_path: Path) -> None:
    arm = planar(HOSTILE, ("<b>q1</b>", "</table><i>", "q3'onload='x"), HOSTILE)
    page = Page(save_with_page(loop(arm, HOSTILE), tmp_path / "proof.json", seconds=0))
    assert not {"script", "b", "i"} & set(page.tags)
    assert page.tags.count("img") == page.text.count("<img alt=") == 1
    assert "\u202e" not in page.text
    assert page.first.startswith("PROVEN BUT NOT VERIFIED")
    assert page.row("Model")[1].startswith("<script>alert(1)</script>")
    assert page.row("<b>q1</b>") and page.row("</table><i>") and page.row("q3'onload='x")


LOCKED = '[strategies.locked]\nkind = "lock"\njoints = ["q3"]\n'


def test_certify_writes_a_page_beside_each_certificate_and_names_it(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    pytest.importorskip("flint")
    outcome = holokin("certify", write_job(tmp_path, strategy=LOCKED), "--out", out)
    assert outcome.code == 0, outcome.err
    folder = out / "job-proof"
    assert f"wrote {folder / 'locked-certificate.html'}" in outcome.out.replace("\n", "")
    assert Page(folder / "locked-certificate.html").first.startswith("PROVEN: ")
    facts = json.loads((folder / "result.json").read_text())
    assert facts["strategies"]["locked"]["checker"] == "verified" and facts["stopped"] is False
    assert facts["files"] == ["locked-certificate.html", "locked-certificate.json", "result.json"]


def test_ctrl_c_in_the_checker_keeps_the_certificate_and_its_page_claims_no_more(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("flint")

    def interrupted(*_arguments: object, **_named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("holokin.proof.recheck.recheck", interrupted)
    outcome = holokin("certify", write_job(tmp_path, strategy=LOCKED), "--out", out)
    assert outcome.code == 130
    page = Page(out / "job-proof" / "locked-certificate.html")
    assert page.first.startswith("PROVEN BUT NOT VERIFIED")
    assert json.loads((out / "job-proof" / "result.json").read_text())["stopped"] is True
    assert json.loads((out / "job-proof" / "locked-certificate.json").read_text())["claims"]["whole"]
