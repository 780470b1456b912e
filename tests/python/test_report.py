#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""af-report on finished runs (report_runs/, of a phantom, shortened): numbers, pages, figures, bad input.

Usage: test_report.py PROGRAM [TEST...]"""
import csv
import html.parser
import json
import math
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv[1]).resolve()
sys.dont_write_bytecode = True
sys.path.insert(0, str(PROGRAM.resolve().parent))

from af_report import failures, figures, numbers, page, provenance, registration, runs  # noqa: E402
from af_programs.errors import ProgramError  # noqa: E402

RUNS = Path(__file__).resolve().parent / "report_runs"
SECRET = b"af-secret-af-secret-af-secret-"
PIXEL = bytes.fromhex("89504e470d0a1a0a0000000d4948445200000001000000010806000000"
                      "1f15c4890000000d49444154789c6360000002000001e221bc330000000049454e44ae426082")
ELEMENTS = set("html head meta title style body main header footer h1 h2 h3 p a nav ul li div span b strong sub code pre br table thead tbody tr th td "
               "dl dt dd img figure figcaption details summary svg line polyline script".split())
ATTRIBUTES = set("class id href src alt lang charset name content scope style role viewbox aria-label x1 x2 y1 y2 points".split())


def run(*arguments, expect=0):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == expect, (done.returncode, done.stdout, done.stderr)
    return done.stdout if expect == 0 else done.stderr


class Page(html.parser.HTMLParser):
    """Elements, attributes, links and texts of a page."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.links, self.sources, self.cells, self.words = set(), [], [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.add(tag)
        for name, value in attributes:
            assert name in ATTRIBUTES, name
            self.links += [value] if name == "href" else []
            self.sources += [value] if name == "src" else []

    def handle_data(self, data):
        self.words += data


class Copied(unittest.TestCase):
    """A copy of the runs, with a picture of every name, beside a file that no page may show."""

    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.folder = Path(self.scratch.name).resolve() / "runs"
        shutil.copytree(RUNS, self.folder)
        (self.folder.parent / "secret").write_bytes(SECRET)
        for path in self.folder.glob("*/summary.json"):
            summary = json.loads(path.read_text())
            named = summary.get("pictures", []) + [summary["difference_images"]] if summary.get("difference_images") else summary.get("pictures", [])
            for entry in named:
                (path.parent / entry["file"]).write_bytes(PIXEL)
                (path.parent / entry.get("slicer", "slicer")).mkdir(parents=True, exist_ok=True)
            (path.parent / "link.png").symlink_to("../../secret")

    def rows(self, name):
        with (self.folder / name).open() as file:
            return list(csv.DictReader(file))

    def summary(self, kind):
        return json.loads((self.folder / kind / "summary.json").read_text())

    def change(self, kind, change):
        summary = self.summary(kind)
        change(summary)
        (self.folder / kind / "summary.json").write_text(json.dumps(summary))

    def page(self):
        return page.page(runs.find_runs([self.folder]), self.folder / "report.html", "")


class Numbers(unittest.TestCase):
    def test_have_three_digits_and_hide_nothing(self):
        for value, text in ((0.26789, "0.268"), (12.345, "12.3"), (1240.4, "1240"), (9.996, "10.0"), (0, "0"), (None, "–"), ("inf", "∞"),
                            (math.nan, "–"), ("7", "–"), (True, "–"), (0.000588, "0.000588"), (-0.1707, "-0.171")):
            self.assertEqual(numbers.three(value), text)
        for share, text in ((1, "100"), (0.9999, "> 99.9"), (0.9375, "93.8"), (0.004, "0.400"), (0, "0")):
            self.assertEqual(numbers.percent(share), text + "\u00a0%")
        self.assertEqual([numbers.time(value).replace("\u00a0", " ") for value in (0.00123, 0.2, 42.58)], ["1.23 ms", "200 ms", "42.6 s"])


class Pages(Copied):
    def test_show_the_numbers_of_summaries_and_rows(self):
        summary, html_of_page = self.summary("registration"), self.page()
        text = Page(html_of_page).words
        starts = self.rows("registration/registrations.csv")
        for renderer in summary["renderers"]:
            rows = [row for row in starts if row["renderer"] == renderer["renderer"]]
            tre = [float(row["tre_mm"]) for row in rows if row["success"] == "1"]
            # The rows' own numbers, computed here, are those of the summary and of the page.
            self.assertEqual(len(rows), renderer["starts"])
            self.assertEqual(len(tre), renderer["successes"])
            self.assertIn(f"{numbers.percent(len(tre) / len(rows))} (", text)
            self.assertIn(numbers.three(sum(tre) / len(tre)), text)
            self.assertIn(numbers.three(renderer["tre_of_all_mm"]["median"]), text)
            self.assertIn(numbers.milliseconds(figures.quantile([float(row["seconds"]) for row in rows], 0.5)), text)
        quality = self.summary("image-quality")
        psnr = sorted(float(row["psnr_db"]) for row in self.rows("image-quality/image-quality.csv"))
        self.assertAlmostEqual(figures.quantile(psnr, 0.5), quality["psnr_db"]["median"])
        self.assertIn(numbers.three(quality["psnr_db"]["median"]), text)
        for step in self.summary("error-budget")["steps"]:
            self.assertIn(numbers.three(step["tre_mm"]), text)
        for setting in self.summary("field-parameters")["settings"]:
            self.assertIn(numbers.three(setting["psnr_db"]["median"]), text)
        for name in ("nan", "NaN", "None", "Undefined"):
            self.assertNotIn(f">{name}<", html_of_page)

    def test_count_the_verdicts_on_right_and_on_wrong_ends(self):
        counts = {"doubtful": {"right": 2, "wrong": 613}, "found": {"right": 741, "wrong": 0}, "not found": {"right": 0, "wrong": 58}}
        self.change("registration", lambda summary: summary["renderers"][0]["uncertainty"].update(verdicts=counts))
        words = Page(self.page()).words
        for row in ("fieldsfound7410", "fieldsdoubtful2613", "fieldsnot found058"):
            self.assertIn(row, words)

    def test_begin_with_the_default_method(self):
        other = self.folder / "another"
        shutil.copytree(self.folder / "registration", other)
        self.change("another", lambda summary: summary["method"].update(preset="paper"))
        self.change("registration", lambda summary: summary["method"].update(preset="robust"))
        found = runs.find_runs([self.folder])
        self.assertEqual([run.name for run in found[:2]], ["registration", "another"])
        table = registration.overview(found[:2])
        self.assertIn("(default)", table.rows[0][1])

    def test_open_alone_and_link_to_what_is_there(self):
        (self.folder / "registration/reproduce.sh").write_text("")
        text = self.page()
        found = Page(text)
        self.assertLessEqual(found.elements, ELEMENTS)
        self.assertTrue(found.sources and all(source.startswith("data:image/") for source in found.sources))
        self.assertNotRegex(text.replace("http://www.w3.org", ""), "https?://")
        self.assertTrue(text.isprintable() or text.startswith("<!DOCTYPE html>"))
        for link in found.links:
            self.assertTrue(f'id="{link[1:]}"' in text if link[0] == "#" else link.endswith("reproduce.sh") or (self.folder / link).exists(), link)
        for name in ("page.css", "page.js"):
            self.assertNotRegex((Path(page.FOLDER) / name).read_text(), r"url\(|@import|fetch\(|XMLHttpRequest|import |eval\(|</s")

    def test_test_no_hypothesis_on_a_few_starts(self):
        test = {"low_90_mm": 0, "high_90_mm": 1, "t_test_p": 0.01, "signed_rank_p": 0.01}
        paired = {"common_starts": 4, "successes": [4, 4], "pairs": 4, "pairs_needed": 10, "mcnemar_p": None, "mean_difference_mm": 0.1}
        text = registration.paired_text(paired).text
        self.assertNotRegex(text, "McNemar|p =|Wilcoxon")
        self.assertRegex(text, r"\(fewer than 10 pairs: no test\).*differs by 0.100 mm on average; fewer than 10 pairs: no test")
        self.assertRegex(registration.paired_text({**paired, "common_starts": 20, "pairs": 20, "mcnemar_p": 1.0, "test": test}).text,
                         "McNemar p = 1.00.*differs by 0.100 mm.*Wilcoxon")

    def test_say_of_one_view_what_its_mrpd_says(self):
        def one_view(summary):
            for case in summary["cases"]:
                case["views"] = 1
            first = summary["renderers"][0]
            for key in ("depth_of_all_mm", "depth_of_successes_mm"):
                first[key].update(count=7, median=5.25, p95=23.5)
            first.update(error="mRPD", successes=1, starts=7, rate=1 / 7)
            first["error_of_successes_mm"]["mean"] = 0.456
        self.change("registration", one_view)
        text = Page(self.page()).words
        self.assertIn("14.3\u00a0%of 7 starts succeed by mRPD", text)
        self.assertIn("0.456 mmmean mRPD of successesdepth off by 5.25 mm (median), 23.5 mm (95th percentile)", text)
        self.assertIn("5.25, 23.5", text)
        self.assertIn("which leaves out the depth", text)
        # The figures show the same error, which the rows have beside their TREs.
        (found,) = runs.find_runs([self.folder / "registration"])
        rows = self.rows("registration/registrations.csv")
        self.assertEqual([start["error_mm"] for start in found.starts], [float(row["mrpd_mm"]) for row in rows])
        self.assertEqual([row[2] for row in figures.figures_of(found)["tre-scatter"]()[2]], [start["error_mm"] for start in found.starts])
        self.assertIn("mRPD (mm)", figures.svg_of(figures.figures_of(found)["tre-histogram"]()[0]).decode())

    def test_say_how_the_xrays_were_made(self):
        def text_of(effects, ideal="false"):
            stress = [{"name": name, "text": "so < much"} for name in effects]
            return " ".join(str(getattr(block, "text", getattr(block, "items", ""))) for block in provenance.simulation_blocks(
                {"program_version": "1.0", "options_toml": f"ideal = {ideal}\n", "stress": stress}))
        self.assertIn("through the CT itself", text_of([]))
        self.assertIn("through the CT after a motion", text_of(["motion"]))
        self.assertIn("<strong>rods</strong>: so &lt; much", text_of(["rods"]))
        self.assertIn("through the original CT (the CT that is registered is a degraded one)", text_of(["degraded-ct"]))
        self.assertIn("through the original CT after a motion", text_of(["degraded-ct", "motion"]))
        self.assertIn("they are line integrals", text_of([], "true"))
        self.assertNotIn("they are line integrals", text_of(["noise"], "true"))

    def test_name_commands_that_repeat_a_start(self):
        start = {"case": "a b", "renderer": "raycast", "start_index": "3"}
        both = {"repeat": {"command": "cd /w && af-evaluate registration", "renderer": "both", "output": "/w/repeats"}}
        self.assertEqual(failures.repeat_command(both, start), "cd /w && af-evaluate registration --case 'a b' --renderer both "
                                                                   "--only-start 3 --output /w/repeats/a_b-raycast-3")
        both["repeat"]["renderer"] = "raycast"
        self.assertIn("--renderer raycast", failures.repeat_command(both, start))
        self.assertEqual(failures.repeat_command({"repeat": None}, start), "")

    def test_hold_nothing_of_changed_runs_but_texts(self):
        values = ["<script>af()</script>", '"><img src=x onerror=af()>', "../../secret", "link.png", "/etc/hostname", "javascript:af()", "a\0b",
                  "//host/x", "nan", "inf", "n" * 300, None, True, -1, 0, 1e300, [], {}, [1, 2, 3], {"a": ["<b>"]}, "field", "\ud800"]
        chance = random.Random(1)
        kinds = ["registration", "error-budget", "similarity-curves", "image-quality", "field-parameters"]
        sound = {kind: self.summary(kind) for kind in kinds}
        made = 0
        # Existing figures are not drawn anew, which would take most of the time.
        for kind in kinds:
            for name in ("success-rate", "tre-scatter", "tre-histogram", "confidence", "psnr", "loss-split", "similarity-curves",
                         "field-parameters"):
                path = self.folder / kind / f"{name}.svg"
                path.write_text("<svg/>")
                os.utime(path, (2**32, 2**32))
        for _ in range(60):
            kind = chance.choice(kinds)
            summary = json.loads(json.dumps(sound[kind]))
            for _ in range(chance.choice((1, 3))):
                place = summary
                while True:
                    key = chance.choice(list(place) if isinstance(place, dict) else range(len(place)))
                    if isinstance(place[key], (dict, list)) and place[key] and chance.random() < 0.85:
                        place = place[key]
                        continue
                    place[key] = chance.choice(values)
                    break
            (self.folder / kind / "summary.json").write_text(json.dumps(summary))
            try:
                text = page.page(runs.find_runs([self.folder / kind]), self.folder / "page.html", "")
            except ProgramError as error:
                self.assertIn(error.exit_code, (3, 4))
                continue
            made += 1
            found = Page(text)
            self.assertLessEqual(found.elements, ELEMENTS)
            self.assertTrue(all(source.startswith("data:image/") for source in found.sources))
            self.assertFalse([link for link in found.links if link.startswith(("/", "javascript")) or ":" in link])
            self.assertNotIn(SECRET.decode(), text)
            self.assertNotIn("YWYtc2VjcmV0", text)
        self.assertGreater(made, 10)


class Runs(Copied):
    def test_are_found_once_and_named_by_what_tells_them_apart(self):
        self.assertEqual(len(runs.find_runs([self.folder, self.folder / "registration"])), 5)
        shutil.copytree(self.folder / "registration", self.folder / "a/skull/registration")
        shutil.copytree(self.folder / "registration", self.folder / "a/thorax 2/registration")
        found = runs.find_runs([self.folder / "a"])
        self.assertEqual([run.name for run in found], ["skull", "thorax 2"])
        found[1].page_folder = self.folder / "a/skull"
        self.assertEqual(found[1].link("starts.csv"), "../thorax%202/registration/starts.csv")
        self.change("a/skull/registration", lambda summary: summary.update(only_start=3))
        self.assertEqual(len(runs.find_runs([self.folder / "a"])), 1)
        self.assertEqual(len(runs.find_runs([self.folder / "a/skull/registration"])), 1)

    def test_give_only_their_own_files(self):
        found = runs.find_runs([self.folder / "registration"])[0]
        for name in ("../secret", "/etc/hostname", "", ".", "..", "link.png", "a/../../x"):
            with self.assertRaises(ProgramError, msg=name):
                found.picture(name)
            if name != "link.png":
                with self.assertRaises(ProgramError, msg=name):
                    found.link(name)


class Program(Copied):
    def test_draws_beside_the_numbers_the_same_bytes_every_time(self):
        drawn = {"registration": ("success-rate", "tre-histogram", "tre-scatter"), "image-quality": ("psnr",),
                 "field-parameters": ("field-parameters",)}
        of_all = [self.folder / kind / name for kind, names in drawn.items() for name in names]
        run(*(self.folder / kind for kind in drawn))
        first = [path.with_suffix(".svg").read_bytes() for path in of_all]
        run(*(self.folder / kind for kind in drawn))
        self.assertEqual([path.with_suffix(".svg").read_bytes() for path in of_all], first)
        for path in of_all:
            self.assertTrue(path.with_suffix(".png").read_bytes().startswith(b"\x89PNG"))
            self.assertFalse(list(path.parent.glob("*.partial")))
        rows = self.rows("registration/success-rate.csv")
        self.assertEqual(sum(int(row["starts"]) for row in rows), sum(entry["starts"] for entry in self.summary("registration")["renderers"]))
        self.assertIn("| Run | Succeeded |", run(self.folder / "error-budget"))

    def test_imports_matplotlib_only_to_draw(self):
        folder = self.folder / "registration"
        page_of = [sys.executable, "-X", "importtime", str(PROGRAM), str(folder), "-o", str(self.folder / "x.html")]
        for has_figures in (False, True):
            if has_figures:
                run(folder)
            done = subprocess.run(page_of, capture_output=True, text=True, check=True)
            self.assertEqual("matplotlib" not in done.stderr, has_figures)

    def test_refuses_bad_input_in_one_line(self):
        (self.folder / "empty").mkdir()
        (self.folder / "list.csv").write_text("a,b\n1,2\n")
        damaged = self.folder / "registration/registrations.csv"
        damaged.write_text(damaged.read_text() + "cut,off\n")
        (self.folder / "image-quality/summary.json").write_text("{")
        self.change("similarity-curves", lambda summary: summary.update(format_version=2))
        self.change("field-parameters", lambda summary: summary.update(kind="strange"))
        out = ["-o", self.folder / "x.html"]
        for code, part, arguments in (
                (2, "usage", []), (2, "unrecognized", ["--nonsense", "x"]), (2, "--title needs", ["--title", "t", self.folder]),
                (3, "holds no finished run", [self.folder / "empty", *out]), (3, "holds no results", [self.folder / "empty"]),
                (3, "columns = a, b", [self.folder / "list.csv"]), (4, "is not a folder", [self.folder / "nowhere", *out]),
                (4, "does not exist", [self.folder / "nowhere"]), (4, "registrations.csv:", [self.folder / "registration", *out]),
                (4, "image-quality/summary.json", [self.folder / "image-quality", *out]), (4, "format_version = 2", [self.folder / "similarity-curves", *out]),
                (4, "kind = strange", [self.folder / "field-parameters", *out]), (4, "in a folder that exists", [self.folder / "error-budget", "-o", self.folder / "no/x"])):
            said = run(*arguments, expect=code)
            self.assertIn(part, said)
            self.assertNotIn("Traceback", said)
            if code != 2:
                self.assertEqual(said.count("\n"), 1, said)
        self.assertFalse((self.folder / "x.html").exists())

    def test_explains_itself_in_every_form(self):
        for form in ("markdown", "man", "bash", "zsh"):
            said = run("--help-as", form)
            self.assertIn("output", said)
        completion = run("--help-as", "bash")
        subprocess.run(["bash", "-n"], input=completion, text=True, check=True)

    def test_says_which_packages_are_missing(self):
        done = subprocess.run([sys.executable, "-S", str(PROGRAM), str(self.folder), "-o", str(self.folder / "x.html")], capture_output=True,
                              text=True, check=False)
        self.assertEqual(done.returncode, 4)
        self.assertIn("apt-get install python3-jinja2 python3-matplotlib", done.stderr)


class Tables(unittest.TestCase):
    def test_of_methods_have_a_line_per_run_and_hide_no_failure(self):
        row = {"run": "skull-fast", "case": "skull", "method": "fast gc bobyqa", "preset": "fast", "similarity": "gc", "optimizer": "bobyqa",
               "renderer": "field", "starts": "400", "capture_range_mm": "at least 16", "gross_failures": "1", "error": "mRPD"}
        for band, starts, successes in (("0_8", 400, 399), ("8_16", 4, 4), ("16_30", 0, 0)):
            row.update({f"starts_{band}_mm": str(starts), f"successes_{band}_mm": str(successes), f"wilson_low_{band}_mm": "0.9",
                        f"wilson_high_{band}_mm": "1", f"rotation_share_{band}_mm": "0.5"})
        for name in ("mean_error_mm", "median_error_mm", "median_depth_mm", "p95_depth_mm", "rotation_bias_deg", "translation_bias_mm",
                     "median_rotation_error_deg", "median_drr_count", "median_seconds"):
            row[name] = "0.25"
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "table.csv"
            with path.open("w") as file:
                writer = csv.DictWriter(file, list(row))
                writer.writeheader()
                writer.writerows([row, {**row, "run": "skull-paper", "preset": "paper", "optimizer": "cma-es"}])
            said = run(path)
            self.assertEqual(said, path.with_suffix(".md").read_text())
            self.assertIn("| skull-fast | skull | fast gc bobyqa | field | 99.8 [90, 100] / 100 [90, 100] / - |", said)
            self.assertIn("| at least 16 | 1 | mRPD 0.250, 0.250 | 0.25, 0.25 |", said)
            self.assertIn("| Study | Renderer | fast | paper |", said)
            self.assertIn("| skull | field | paper | gc |  | 99.8 / 100, 0.250 |", run(path, "--screen"))

    def test_of_populations_take_conditions_of_any_name(self):
        columns = ["condition", "group", "patients", "starts", "error", "median_error_mm", "median_depth_mm", "p95_depth_mm", "median_seconds",
                   "success_mm", "commit"]
        parts = ["rate", "student_low", "student_high", "bootstrap_low", "bootstrap_high", "capture_mm", "patients_capture_mean_mm",
                 "patients_capture_bootstrap_low_mm", "patients_capture_bootstrap_high_mm", "patients_capture_lower_bounds",
                 "patients_with_failures", "below_1_mm", "below_5_mm", "capture_ended_by"]
        names = ("clean-2-robust", "clean-1-robust", "clean-2-paper", "word")
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            with (folder / "population.csv").open("w") as file:
                writer = csv.writer(file)
                writer.writerow(columns + parts)
                for name in names:
                    error = ["mRPD", 0.1, 5, 12] if "-1-" in name else ["TRE", 0.1, "nan", "nan"]
                    writer.writerows([name, group, 3, 12, *error, 0.5, 2.5, "abc", "0.8333", "nan", "nan", "0.5", "1", "4", "3", "2", "4", "1", "1",
                                      "10", "10", "last interval"] for group in ("all", "odd", "spine"))
            (folder / "patients.csv").write_text("condition,patient,capture_mm\n" + "".join(
                f"{name},spine-00{number},4\n" for name in names for number in (1, 2, 3)))
            (folder / "intervals.csv").write_text("condition,error,low_mm,high_mm,starts,successes,bootstrap_low,bootstrap_high\n" + "".join(
                f"{name},{'mRPD' if '-1-' in name else 'TRE'},{low},{low + 2},6,5,0.5,1\n" for name in names for low in (0, 2)))
            said = run(folder)
            line = "| 12 | {} | 83.3 | 50.0 to 100.0 | - to - | 83.3 / 83.3 | >= 4.0 | >= 3.0 (2.0 to 4.0) | 0.10 | {} | 0.500 |"
            self.assertIn("| clean-2-robust | all | 3, 1 " + line.format("TRE", "-, -"), said)
            self.assertIn("| clean-1-robust | all | 3, 1 " + line.format("mRPD", "5.0, 12.0"), said)
            self.assertIn("| word | 83.3, 4.0 |", said)
            drawn = (folder / "success.svg").read_text()
            for title in ("clean-2 views, by TRE", "clean-1 view, by mRPD", "word, by TRE"):
                self.assertIn(title, drawn)
            self.assertTrue((folder / "capture-range.png").exists())


class Browser(Copied):
    PROBE = """<script>
      for (const button of document.querySelectorAll('th button')) button.click();
      const title = document.querySelector('th');
      title.querySelector('button')?.click();
      document.body.dataset.probe = JSON.stringify({
        broken: [...document.images].filter((i) => !i.complete || i.naturalWidth === 0).length,
        cut: document.documentElement.scrollWidth - document.documentElement.clientWidth,
        tables: [...document.querySelectorAll('.scroll')].filter((t) => t.scrollWidth > t.clientWidth + 1).length,
        sorted: document.querySelectorAll('th[aria-sort]').length});
      </script></body>"""

    def test_shows_the_page_without_complaint_and_cuts_no_table(self):
        chromium = shutil.which("chromium")
        if not chromium and not os.environ.get("AF_REQUIRE_TOOLS"):
            self.skipTest("chromium is not installed (jobs/install-packages.sh --with-lint installs it)")
        probed = self.folder / "page.html"
        probed.write_text(self.page().replace("</body>", self.PROBE))
        for width in (1280, 390):
            done = subprocess.run([chromium, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", f"--window-size={width},900",
                                   f"--user-data-dir={self.folder / 'profile'}", "--dump-dom", probed.as_uri()], capture_output=True, text=True,
                                  check=True, timeout=120)
            self.assertNotIn("CONSOLE", done.stderr)
            found = json.loads(re.search(r'data-probe="([^"]*)"', done.stdout)[1].replace("&quot;", '"'))
            self.assertEqual((found["broken"], found["cut"]), (0, 0))
            self.assertGreater(found["sorted"], 0)
            if width == 1280:
                self.assertEqual(found["tables"], 0)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
