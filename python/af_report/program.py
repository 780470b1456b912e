# SPDX-License-Identifier: Apache-2.0
"""The command line of af-report."""
import argparse
import gc
import os
import sys
from pathlib import Path

from af_programs.argument_pages import add_common_options
from af_programs.errors import FileError, InputError, ProgramError

MODULES = {"jinja2": "python3-jinja2", "matplotlib": "python3-matplotlib"}


def parser():
    program = argparse.ArgumentParser(
        prog="af-report", description="Makes a page, figures and tables for people from the numbers that af-evaluate writes. With "
        "--output it makes one page of all finished runs in and below the folders; without it figures and tables beside their "
        "numbers.", allow_abbrev=False)
    program.add_argument("paths", metavar="PATH", nargs="+", help="Folders of results; without --output also tables (NAME.csv) of "
                         "af-evaluate compare and held-out, jobs/rate-against-truth.sh and bench-scaling")
    program.add_argument("-o", "--output", metavar="PATH", help="The page to write")
    program.add_argument("--title", metavar="TEXT", help="The page's title (default: made from the cases' names)")
    program.add_argument("--screen", action="store_true", help="For tables of compare: measures against optimisers instead of a row per run")
    add_common_options(program)
    return program


def write_page(options):
    from .files import write_file
    from .page import page
    from .runs import find_runs
    output = Path(options.output)
    if output.is_dir() or not output.resolve().parent.is_dir():
        raise FileError(f"--output = {output}: must be a file in a folder that exists")
    runs = find_runs(options.paths)
    write_file(output, page(runs, output, options.title))
    print(f"report of {len(runs)} run(s): {output}")


def write_table(text, path):
    from .files import write_file
    write_file(path, text)
    print(text, end="", flush=True)


def draw_table(path, is_screen):
    """Writes NAME.md and figures for a table, which is recognised by its columns."""
    from . import studies, tables
    from .files import columns_of
    makers = {"rotation_share_0_8_mm": tables.comparison, "smoothed_psnr_db": tables.held_out, "mb_per_camera": studies.rates,
              "ranks": studies.scaling}
    columns = columns_of(path)
    for column, make in makers.items():
        if column in columns:
            text = make(path, is_screen)
            if text:
                write_table(text, path.with_suffix(".md"))
            return
    raise InputError(f"{path}: columns = {', '.join(columns)[:80]}: must be those of a table of af-evaluate compare or held-out, of "
                       "jobs/rate-against-truth.sh, or of bench-scaling")


def draw_folder(folder):
    """Writes the figures and tables of one folder, as far as its kind has some."""
    from . import figures, population, tables
    from .files import columns_of, rows_of
    from .runs import Run, is_papers_setting, read_summary
    summary = read_summary(folder / "summary.json") if (folder / "summary.json").is_file() else None
    if summary is not None:
        for name, draw in figures.figures_of(Run(folder.resolve(), summary)).items():
            figures.save(draw(), folder / name)
        if summary["kind"] == "error-budget":
            write_table(tables.budget_of(folder / "summary.json"), folder / "error-budget.md")
    elif (folder / "population.csv").is_file():
        for name, draw in (("success", population.success), ("capture-range", population.capture_ranges)):
            drawn = draw(folder)
            if drawn:
                figures.save(drawn, folder / name)
        write_table(tables.population(folder), folder / "population.md")
    elif (folder / "image-quality.csv").is_file() and "camera" in columns_of(folder / "image-quality.csv"):
        groups = figures.psnr_of_rows(rows_of(folder / "image-quality.csv"), "")
        parts = [read_summary(path) for path in sorted(folder.glob("*/summary.json"))]
        are_papers = bool(parts) and all(part is not None and is_papers_setting(Run(folder, part)) for part in parts)
        figures.save(figures.psnr_boxes(groups, are_papers), folder / "psnr")
    else:
        raise InputError(f"PATH = {folder}: holds no results of af-evaluate")


def run(options):
    if options.output:
        write_page(options)
        return
    for path in map(Path, options.paths):
        if path.is_dir():
            draw_folder(path)
        elif path.is_file():
            draw_table(path, options.screen)
        else:
            raise FileError(f"{path}: does not exist")


def main():
    options = parser().parse_args()
    if (options.title or options.screen) and bool(options.title) != bool(options.output):
        parser().error("--title needs --output, and --screen must not be given with it")
    # Importing and drawing make many objects that stay. Looking for garbage after every 700 takes a tenth of the time.
    gc.set_threshold(100_000)
    try:
        run(options)
        sys.stdout.flush()
        return 0
    except ProgramError as error:
        problem, code = str(error), error.exit_code
    except ModuleNotFoundError as error:
        if error.name not in MODULES:
            raise
        problem, code = f"the Python module {error.name} is missing; on Debian: apt-get install {' '.join(MODULES.values())}", 4
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        problem, code = f"{', '.join(options.paths)}: a summary.json or a table lacks something: {error!r}", 4
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 4
    except KeyboardInterrupt:
        return 130
    except OSError as error:
        problem, code = str(error), 4
    sys.stdout.flush()
    print(f"af-report: {problem}", file=sys.stderr)
    return code
