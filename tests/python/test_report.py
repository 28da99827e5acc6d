"""Reports from synthetic studies: what is shown, that it stands alone, and that nothing bad breaks it."""
import csv
import math
import re
import shutil
import subprocess
from html.parser import HTMLParser
from types import SimpleNamespace

import pytest
from conftest import REPORTS
from synthetic import write_result, write_study
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.draw.figures import draw
from testbed_reports.page.report import build, main
from testbed_reports.draw.style import Style
from testbed_reports.draw.table import Table, as_latex, escape
from testbed_reports.page.tables import convergence_table, performance_table, power_law_table, slow_runs, study_tables

EXTRA = """
[[target]]
label = "LPFDM converges"
quantity = "stress"
norm = "l2"
where = {variant = "lpfdm"}
kind = "order_min"
value = 1.8
source = "theory <&>"
[[target]]
label = "FEM is exact"
quantity = "stress"
norm = "l2"
where = {variant = "fem-q2"}
kind = "value_max"
value = 1e-3
[[figure]]
kind = "convergence"
quantity = "stress"
norm = "l2"
orders = [1, 2]
paper = "Errors fall with the <second> power of L & no faster."
shows = "The order is two."
[[figure]]
kind = "work_precision"
quantity = "displacement"
norm = "l2"
[[figure]]
kind = "profile"
component = "stress_yy"
[[figure]]
kind = "field"
component = "stress_yy"
[[figure]]
kind = "history"
probe = "tip"
quantity = "displacement_y"
scale_x = "period"
scale_y = "static_displacement"
[[figure]]
kind = "history"
quantity = "total_energy"
[[figure]]
kind = "bars"
quantity = "particle_steps_per_second"
[[figure]]
kind = "bars"
quantity = "nothing"
paper = "Nothing comes of nothing."
"""


PAGES = [("report.html", 2), ("gallery.html", 1)]  # and their pictures


def change(variant, L, repeat):
    """A diverged run, a killed one, one on a busy machine."""
    if variant == "mpm-cpgimp" and L == 0.5:
        return {"status": "diverged", "reason": "velocity above <c_p>"}
    if variant == "mpm-linear" and L == 0.5:
        return None
    return {"load": 5.0} if variant == "lpfdm" and L == 2.0 else {}


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    root = tmp_path_factory.mktemp("report")
    folder = write_study(root / "studies" / "column", EXTRA, sizes=(2.0, 1.0, 0.5), left_out=["fem-q2"], change=change,
                         metrics="stress,displacement,static,nonsense",
                         history={"strain_energy": [1.0] * 80 + [2.0]})
    bad = folder / "runs" / "lpfdm_L1_r1_0" / "result.h5"
    bad.write_bytes(bad.read_bytes()[:5000])
    write_result(folder / "runs" / "stale_0a1b2c3d-4e5f" / "result.h5", variant="stale")
    write_result(folder / "runs" / "cb-geo_fine" / "result.h5", variant="cb-geo")
    broken = root / "studies" / "broken"
    broken.mkdir()
    (broken / "study.toml").write_text("title = 1\n")
    build([root / "studies"], root / "out", "testbed report studies")
    return root / "out"


@pytest.fixture(scope="module")
def page(report):
    return (report / "report.html").read_text()


def text_of(page):
    page = re.sub(r"<(style|script|svg)\b.*?</\1>", "", page, flags=re.S)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page))


def test_figures_for_print(report):
    names = {p.name for p in (report / "figures").glob("*.pdf")}
    assert {"column_convergence_stress_l2.pdf", "column_field_stress_yy.pdf", "column_history_total_energy.pdf"} <= names
    assert len(names) == 7 and all((report / "figures" / n).read_bytes().startswith(b"%PDF") for n in names)


class Balance(HTMLParser):
    """Every tag is closed in order."""

    def __init__(self, text):
        super().__init__()
        self.stack = []
        self.feed(text)
        assert self.stack == []

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "link", "img", "br"):
            self.stack.append(tag)

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag


@pytest.mark.parametrize("name, pictures", PAGES)
def test_pages_stand_alone(report, name, pictures):
    page = (report / name).read_text()
    rest = re.sub(r"data:[^\"']*", "", re.sub(r"<script.*?</script>", "", page, flags=re.S))
    rest = re.sub(r'xmlns(:\w+)?="[^"]*"|url\(#\w+\)', "", re.sub(r"<metadata>.*?</metadata>", "", rest, flags=re.S))
    assert not re.search(r"https?://|file://|<link(?![^>]*href=\"\")|@import|url\(", rest) and not re.search(r"<script[^>]*src", page)
    assert len(re.findall(r'<img src="data:image/svg\+xml;base64,', page)) == pictures
    Balance(page)


def test_gallery_sets_words_beside_pictures(report, page):
    gallery = (report / "gallery.html").read_text()
    text = text_of(gallery)
    assert "The paper Errors fall with the &lt;second&gt; power of L &amp; no faster." in text
    assert "The order is two." in text and text.index("Errors fall") < text.index("The order is two.")
    assert "Not drawn" in text and "Nothing comes of nothing." in text  # a figure that failed is not hidden
    assert "Displacement" not in text and gallery.count('class="pair"') == 2  # figures without words stay in the report
    assert 'href="gallery.html"' in page and 'href="report.html"' in gallery
    for anchor in re.findall(r'href="report\.html#([^"]+)"', gallery):
        assert f'id="{anchor}"' in page


def test_no_words_no_gallery(tmp_path):
    folder = write_study(tmp_path / "s", EXTRA, sizes=(1.0,), metrics="stress")
    out = build([folder], tmp_path / "out", "testbed report s").parent
    assert (out / "gallery.html").exists()
    study = folder / "study.toml"
    study.write_text(re.sub(r"^(paper|shows) = .*\n", "", study.read_text(), flags=re.M))
    page = build([folder], out, "testbed report s").read_text()
    assert not (out / "gallery.html").exists() and "gallery.html" not in page


def test_page_says_what_failed(page):
    text = text_of(page)
    for told in ("velocity above &lt;c_p&gt;", "killed by signal 9", "unreadable", "nonsense", "not drawn", "the whole study",
                 "testbed-fem) is not built", "abc1234", "theory &lt;&amp;&gt;", "testbed study column.toml"):
        assert told in text, told
    assert "stale" not in text  # a run of an earlier plan
    assert "cb-geo_fine" in text and "of another code" in text


def test_verdicts_on_page(page):
    text = text_of(page)
    assert "1 fail, 1 not run" in text and "✗ fail" in text  # an unreadable run is no pass
    assert "kinetic/strain energy" in text


def test_busy_machine_is_marked(report):
    with open(report / "tables" / "column_performance.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [r["load"] for r in rows if r["variant"] == "lpfdm" and r["L [m]"] == "2"] == ["5.00 busy"]
    assert [r["status"] for r in rows if r["variant"] == "mpm-cpgimp" and r["L [m]"] == "0.5"] == ["diverged"]


def test_convergence_table(tmp_path):
    study = read_study_folder(write_study(tmp_path / "c", sizes=(2.0, 1.0, 0.5), metrics="stress", change=change))
    table = convergence_table(study, "stress", "l2")
    assert table.header == ["variant", "L = 2 m", "L = 1 m", "order", "L = 0.5 m", "order", "order of all"]
    rows = {row[0]: row for row in table.rows}
    assert rows["lpfdm"][2] == "0.0200" and rows["lpfdm"][3] == "2.00"
    assert rows["mpm-cpgimp"][4] == "diverged" and rows["mpm-linear"][4] == "missing"
    assert rows["fem-q2"][-1].startswith("2.00")


def test_performance_medians(tmp_path):
    study = read_study_folder(write_study(tmp_path / "p", sizes=(1.0,), models={"lpfdm": lambda L: 0.1}, repeats=3,
                                          change=lambda v, L, r: {"solve_s": [1.0, 5.0, 2.0][r - 1]}))
    row = dict(zip(performance_table(study).header, performance_table(study).rows[0]))
    assert row["solve [s]"] == "2.00 [1.00–5.00]" and row["memory [B/point]"] == "200"


def test_runs_below_the_rate_of_their_scene_are_told():
    """Small runs are slow by themselves; one with more points than another has no reason to be."""
    def run(points, rate):
        return SimpleNamespace(result=SimpleNamespace(performance={"points": points, "particle_steps_per_second": rate}))
    small, middle, lagging, large = run(300, 4e6), run(10000, 2e7), run(10000, 0.9e7), run(1e5, 1.1e7)
    assert slow_runs([small, middle, lagging, large, SimpleNamespace(result=None)]) == [lagging]
    assert slow_runs([small, middle, run(1e5, 0.9e7)])[0].result.performance["points"] == 1e5


def test_power_law_of_all_seeds(tmp_path):
    """w = 1.2 L^0.5 but for a factor of e^(+-0.1) by seed."""
    figure = '[[figure]]\nkind = "power_law"\nquantity = "stress"\nnorm = "l2"\n'
    folder = write_study(tmp_path / "p", figure, sizes=(0.5, 0.25, 0.125), metrics="stress", repeats=2,
                         models={"lpfdm": lambda L: 1.0, "mpm-linear": lambda L: 1.0},
                         change=lambda v, L, r: None if (v, L) == ("mpm-linear", 0.5) else {
                             "stress_error": 1.2 * L**0.5 * math.exp(0.1 if r == 1 else -0.1), "seed": r})
    study = read_study_folder(folder)
    rows = {(row[0], row[1]): row for row in power_law_table(study, "stress").rows}
    assert rows["lpfdm", "l2"][2] == "0.500" and rows["lpfdm", "l2"][4] == "1.200" and rows["lpfdm", "l2"][6] == "6"
    assert rows["mpm-linear", "l2"][6] == "4 of 6" and ("lpfdm", "linf") in rows
    assert [t.name for t in study_tables(study)].count("power_law_stress") == 1
    drawing = draw(study, study.spec.figures[0], Style(study.variants()))
    dots, means, line = drawing.figure.axes[0].lines[:3]
    assert len(dots.get_xdata()) == 6 and list(means.get_xdata()) == [0.125, 0.25, 0.5]
    assert list(means.get_ydata()) == pytest.approx([1.2 * L**0.5 * math.cosh(0.1) for L in means.get_xdata()])
    assert list(line.get_ydata()) == pytest.approx([1.2 * 0.125**0.5, 1.2 * 0.5**0.5])
    assert any("mpm-linear gave no number at L = 0.5 m" in note for note in drawing.notes)


def test_latex(report):
    files = list((report / "tables").glob("*.tex"))
    assert 2 < len(files) < len(list((report / "tables").glob("*.csv")))  # what is folded away on the page is not for print
    for path in files:
        text = path.read_text()
        blocks = re.findall(r"\\begin\{tabular\}\{@\{\}(.*?)@\{\}\}\n\\toprule(.*?)\\bottomrule\n\\end\{tabular\}", text, re.S)
        assert len(blocks) == text.count(r"\begin{") == text.count(r"\end{") >= 1
        for columns, body in blocks:
            columns = len(re.sub(r">\{[^}]*\}p\{[^}]*\}", "p", columns))
            for line in body.splitlines():
                if line.endswith(r"\\"):
                    assert len(re.findall(r"(?<!\\)&", line)) == columns - 1, line
            assert not re.search(r"(?<!\\)[%#_]", body.replace("_{", "")) and text.isascii()
        depth = 0
        for c in re.sub(r"\\[{}]", "", text):
            depth += (c == "{") - (c == "}")
            assert depth >= 0
        assert depth == 0


def test_escape():
    assert escape("a_b & 5%") == r"a\_\allowbreak{}b \& 5\%" and escape("1.50e-04") == r"$1.50\times10^{-4}$"
    assert escape("≤ 1–2") == r"$\le$ 1--2"
    assert "\\begin{tabular}{@{}lr@{}}" in as_latex(Table("n", "t", ["a", "b"], [["x", "1"]]))


def test_same_variant_same_look():
    style = Style(["mpm-b", "lpfdm", "fem-q2", "mpm-a", "lpfdm-2000"])
    looks = [str(style.of(v)) for v in ("lpfdm", "lpfdm-2000", "mpm-a", "mpm-b", "fem-q2")]
    assert len(set(looks)) == 5 and str(style.of("lpfdm")) == looks[0]
    assert len({style.colour(v) for v in style.slots}) == 5 == len({style.marker(v) for v in style.slots})
    assert str(Style(["mpm-x", "lpfdm"]).of("lpfdm")) == looks[0]  # the same in every report
    slow, fast = (style.of(f"lpfdm, cfl = {cfl}") for cfl in (0.1, 0.9))  # settings of one are told apart, even in grey
    assert slow["color"] == fast["color"] and all(slow[k] != fast[k] for k in ("marker", "linestyle", "markerfacecolor"))
    style.begin_figure()
    assert style.of("lpfdm, cfl = 0.9") | {"gid": ""} == style.of("lpfdm") | {"gid": ""}


def test_every_run_lost_still_makes_a_page(tmp_path):
    folder = write_study(tmp_path / "lost", EXTRA, sizes=(1.0,), change=lambda *_: None)
    out = build([folder], tmp_path / "out", "testbed report lost")
    assert text_of(out.read_text()).count("killed by signal 9") >= 4


@pytest.mark.parametrize("lost, code", [({}, 0), ({"status": "diverged", "reason": "x"}, 0), (None, 1), ({"status": "interrupted", "reason": "stopped"}, 1)])
def test_exit_code_of_a_study_that_was_killed(tmp_path, capsys, lost, code):
    """What failed is data; what never ran to its end is not."""
    folder = write_study(tmp_path / "s", sizes=(2.0, 1.0), metrics="stress", change=lambda v, L, r: lost if (v, L) == ("lpfdm", 1.0) else {})
    assert main([str(folder), "-o", str(tmp_path / "out")]) == code
    assert ("lpfdm_L1_r1_0" in capsys.readouterr().err) is bool(code)


def test_every_run_diverged_still_makes_a_page(tmp_path):
    folder = write_study(tmp_path / "lost", EXTRA, sizes=(1.0,), metrics="stress",
                         change=lambda *_: {"status": "diverged", "reason": "not a number"})
    assert "not a number" in build([folder], tmp_path / "out", "testbed report lost").read_text()


def test_command(tmp_path):
    write_study(tmp_path / "all" / "one", sizes=(2.0, 1.0))
    done = subprocess.run([REPORTS / "testbed-report", "all", "-o", "page"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == "page/report.html\n", done.stderr
    done = subprocess.run([REPORTS / "testbed-report", "nowhere"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and "nowhere" in done.stderr


@pytest.mark.skipif(not shutil.which("chromium"), reason="chromium is not installed")
@pytest.mark.parametrize("name, pictures", PAGES)
def test_in_a_browser(report, tmp_path, name, pictures):
    """Every picture loads with a size, and the console stays silent. The probe is added to a copy of the page."""
    probe = """<script>addEventListener('load', () => { document.title = 'IMAGES ' +
      [...document.images].map(i => i.naturalWidth > 0 && i.naturalHeight > 0 && i.clientWidth > 100).join(' ') +
      ' WIDE ' + (document.documentElement.scrollWidth <= innerWidth); });</script>"""
    copy = tmp_path / "copy.html"
    copy.write_text((report / name).read_text().replace("</body>", probe + "</body>"))
    options = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0",
               f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1200,1000"]
    done = subprocess.run([*options, "--dump-dom", copy.as_uri()], capture_output=True, text=True, timeout=50)
    title = re.search(r"<title>(.*?)</title>", done.stdout).group(1)
    assert title == "IMAGES " + " ".join(["true"] * pictures) + " WIDE true", title
    assert "CONSOLE" not in done.stderr
    picture = tmp_path / "page.png"
    subprocess.run([*options, f"--screenshot={picture}", (report / name).as_uri()], capture_output=True, timeout=50)
    assert picture.stat().st_size > 20000


PROBE = """<script>addEventListener('load', () => {
  const told = [], figure = [...document.querySelectorAll('figure')].find(f => f.querySelector('script'));
  const canvas = figure.querySelector('.canvas'), svg = canvas.querySelector('svg'), tip = document.querySelector('.tip');
  const point = JSON.parse(figure.querySelector('script').textContent)[0];
  canvas.scrollIntoView();
  const box = svg.getBoundingClientRect();
  const at = {clientX: box.left + point.x * box.width, clientY: box.top + point.y * box.height, bubbles: true};
  canvas.dispatchEvent(new PointerEvent('pointermove', at));
  told.push('hover ' + tip.classList.contains('shown') + tip.textContent.includes(point.run));
  const buttons = [...figure.querySelectorAll('.tools button')], series = buttons.find(b => b.className === 'series');
  buttons[0].click();
  told.push('zoom ' + svg.style.transform.includes('scale(1.6)'));
  buttons[2].click();
  told.push('whole ' + svg.style.transform.includes('scale(1)'));
  series.click();
  told.push('off ' + (canvas.querySelectorAll('.off').length > 0));
  series.click();
  told.push('on ' + canvas.querySelectorAll('.off').length);
  const table = document.querySelector('#failures ~ .wide table'), head = table.querySelectorAll('th')[1];
  head.click();
  const column = [...table.tBodies[0].rows].map(row => row.cells[1].textContent);
  told.push('sorted ' + (column.length > 2 && column.join() === [...column].sort().join()));
  canvas.dispatchEvent(new MouseEvent('click', at));
  told.push('run ' + (location.hash === '#run-' + point.run) + document.getElementById('run-' + point.run).closest('details').open);
  told.push('pictures ' + [...document.querySelectorAll('.canvas svg')].every(s => s.clientWidth > 100 && s.clientHeight > 50));
  document.title = told.join(', ');
});</script>"""


@pytest.mark.skipif(not shutil.which("chromium"), reason="chromium is not installed")
@pytest.mark.parametrize("window", ["1400,1000", "420,900"])
def test_hover_zoom_sort(report, tmp_path, window):
    """A point tells of its run and leads to it, a figure grows and shrinks, a series goes and comes, a table is sorted."""
    copy = tmp_path / "copy.html"
    copy.write_text((report / "report.html").read_text().replace("</body>", PROBE + "</body>"))
    done = subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0", f"--user-data-dir={tmp_path / 'profile'}",
                           f"--window-size={window}", "--dump-dom", copy.as_uri()], capture_output=True, text=True, timeout=50)
    title = re.search(r"<title>(.*?)</title>", done.stdout).group(1)
    assert title == "hover truetrue, zoom true, whole true, off true, on 0, sorted true, run truetrue, pictures true"
    assert "CONSOLE" not in done.stderr
