# SPDX-License-Identifier: Apache-2.0
"""The page with all runs. It opens without a network."""
from pathlib import Path

import jinja2
from markupsafe import Markup

from af_programs.errors import FileError

from . import other_kinds, provenance, registration
from .blocks import Section, Terms

FOLDER = Path(__file__).resolve().parent


def default_title(runs):
    kinds = {run.kind for run in runs}
    if kinds == {"error-budget"}:
        return "Error budget of registrations"
    if kinds == {"similarity-curves"}:
        return "Shape of the similarity"
    cases = sorted({case["case"] for run in runs if run.kind == "registration" for case in run.summary["cases"]})
    if not cases:
        return "Image quality of attenuation fields"
    return f"Registration of {len(cases)} cases" if len(cases) > 4 else f"Registration of {', '.join(cases)}"


def sections(runs_of_kind):
    registrations = runs_of_kind["registration"]
    for run in registrations:
        yield registration.section(run, "Registration accuracy" if len(registrations) == 1 else f"Registration: {run.name}")
    for kind, make in (("error-budget", other_kinds.error_budget), ("similarity-curves", other_kinds.similarity),
                       ("image-quality", other_kinds.image_quality), ("field-parameters", other_kinds.field_parameters),
                       ("registration", provenance.xrays)):
        if runs_of_kind[kind]:
            yield make(runs_of_kind[kind])
    yield Section("words", "What the words mean", [Terms(provenance.WORDS)])


def page(runs, output, title):
    """The page as text. Raises FileError if a summary.json lacks something."""
    for run in runs:
        run.page_folder = Path(output).resolve().parent
    try:
        runs_of_kind = {kind: [run for run in runs if run.kind == kind] for kind in provenance.TITLES}
        registrations, qualities = runs_of_kind["registration"], runs_of_kind["image-quality"]
        findings = registration.findings(registrations[0]) if registrations else []
        if qualities:
            findings.append(other_kinds.quality_sentence(qualities))
        environment = jinja2.Environment(loader=jinja2.FileSystemLoader(FOLDER), autoescape=True, trim_blocks=True, lstrip_blocks=True)
        style, script = (Markup((FOLDER / name).read_text(encoding="utf-8")) for name in ("page.css", "page.js"))
        return environment.get_template("page.html").render(
            title=title or default_title(runs), style=style, script=script, findings=findings,
            version=runs[0].summary["provenance"]["program_version"],
            date=runs[0].summary["provenance"]["started_utc"][:10],
            tiles=registration.tiles(registrations[0]) if registrations else [],
            overview=registration.overview(registrations) if registrations else None,
            comparison=registration.comparison(registrations) if registrations else None, caution=provenance.caution(registrations),
            sections=[*sections(runs_of_kind), provenance.provenance(runs)])
    except (KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError, ZeroDivisionError) as error:
        raise FileError(f"summary.json or a table of a run lacks something, or holds something else than a number or a text: {error!r}") from error
