# SPDX-License-Identifier: Apache-2.0
"""Sections on how X-rays were made, what words mean, and how every run can be repeated."""
from markupsafe import Markup

from .blocks import Items, Section, Terms, Text, heading, strong
from .numbers import whole

SIMULATION = {
    "tube-kvp": ("Tube voltage", "kV"), "aluminium-mm": ("Filter", "mm aluminium"),
    "scatter-to-primary": ("Scatter-to-primary ratio", ""),
    "photons-per-pixel": ("Photons per pixel, open beam (Poisson noise)", ""), "blur-sigma-px": ("Detector blur, sigma", "pixels"),
    "bits": ("Quantisation", "bits"),
    "max-offset-rotation-deg": ("True pose: drawn within, per angle", "degrees of nominal"),
    "max-offset-translation-mm": ("True pose: drawn within, per axis", "mm of nominal"), "seed": ("Seed", "")}

WORDS = [
    ("DRR", "Digitally reconstructed radiograph: an image of line integrals through the CT, dimensionless."),
    ("Attenuation field", "The line integrals of all rays of a motion range, tabulated on two planes, vector-quantised; a DRR is a look-up "
                          "(Russakoff et al., IEEE TMI 24(11), 2005)."),
    ("TRE", "Target registration error: the mean distance, over points 2 mm apart or less in the target box, between where the found pose "
            "and the gold pose put them; mm."),
    ("Gold pose", "From fiducials: each is back-projected from all views, and the CT's fiducials are fitted to these points rigidly (Arun "
                  "1987). FRE is the RMS residual of that fit; a ray gap the shortest distance between the two views' rays."),
    ("Gold standard by itself", "The mean TRE that the fiducials' gold pose has with respect to the true pose, by Monte Carlo on the "
                                "residuals of the fiducials; a TRE below it is not measured. Leave-one-out: how far a fiducial lies from "
                                "where the pose fitted to the others puts it (RMS)."),
    ("Stated pose", "The pose that the study itself gives (gold_room_from_ct); for simulated X-rays the true one, free of the fiducials' "
                    "detection noise."),
    ("Success", "TRE below the run's threshold, 2.5 mm unless it states another; with one view, mRPD. Failures of every kind stay in the "
                "denominator."),
    ("Depth off", "With one view: how far the found pose moves the target's centre along the beam, to either side, from where the gold pose "
                  "puts it; mm. It hardly shows, so that success does not count it."),
    ("mRPD", "Mean reprojection distance: of a target point at the gold pose from the line through the source and the same point at the "
             "found pose; mm (van de Kraats et al., IEEE TMI 24(9), 2005)."),
    ("Confidence", "What a registration states of its own end, without the truth: that it is right, from 0 to 1. From 0.99 on the "
                   "verdict is found, below 0.05 not found."),
    ("95 % interval", "Wilson's score interval. It treats starts as independent; starts of one patient share a CT and its X-rays, so it says "
                      "nothing about other patients."),
    ("PSNR", Markup("20 log<sub>10</sub>(I<sub>max</sub> / RMS difference), I<sub>max</sub> the reference's maximum, over pixels whose ray "
                    "meets matter; dB."))]

TITLES = {"registration": "Registration", "similarity-curves": "Similarity curves", "error-budget": "Error budget",
          "field-parameters": "Field parameters", "image-quality": "Image quality"}


def options_of(toml):
    lines = [line.partition("=") for line in str(toml).splitlines() if "=" in line and not line.startswith("#")]
    return {key.strip(): value.strip().strip('"').removesuffix(".0") for key, _, value in lines}


def imaged_ct(effects):
    if {"degraded-ct", "motion"} <= effects:
        return "the original CT after a motion that deformed it (the CT that is registered is a degraded one, from before the motion)"
    if "degraded-ct" in effects:
        return "the original CT (the CT that is registered is a degraded one)"
    if "motion" in effects:
        return "the CT after a motion that deformed it (the CT that is registered is from before the motion)"
    return "the CT itself"


def simulation_blocks(simulation):
    """How af-simulate made a study's X-rays."""
    if not simulation:
        return [Text("Nothing beside the study says that its X-rays were simulated: they are taken to be real.")]
    options = options_of(simulation.get("options_toml", ""))
    stress = simulation.get("stress") or []
    effects = [Markup("<strong>%s</strong>: %s") % (effect.get("name", ""), effect.get("text", "")) for effect in stress]
    text = Markup("The X-rays were simulated by <code>af-simulate</code> %s through %s, ") % (
        simulation.get("program_version", ""), imaged_ct({effect.get("name") for effect in stress}))
    if options.get("ideal") == "true":
        text += Markup("with %s (<code>--ideal</code>)%s") % (strong("every effect switched off"), (
            " but those named below." if effects else ": they are line integrals, and errors are smaller than with X-rays."))
        blocks = [Text(text)]
    else:
        text += ("by an exact projector (Siddon) instead of the ray caster that made the fields, with a polychromatic spectrum, scatter, "
                 "noise and detector blur, so that the images differ from any DRR as X-rays do.")
        blocks = [Text(text), Terms([(label, f"{options[key]} {unit}") for key, (label, unit) in SIMULATION.items() if key in options])]
    if effects:
        blocks += [Text(Markup("The X-rays are harder than that, as real ones are (<code>--stress</code>):")), Items(effects)]
    return blocks


def xrays(runs):
    """Runs of one study say the same, so it is said once, with their names."""
    found = []
    for run in runs:
        blocks = simulation_blocks(run.summary.get("simulation"))
        same = next((names for names, known in found if known == blocks), None)
        if same is None:
            found.append(([run.name], blocks))
        else:
            same.append(run.name)
    return Section("xrays", "How the X-rays were made", [
        block for names, blocks in found for block in ([heading(", ".join(names))] if len(found) > 1 else []) + blocks])


def caution(runs):
    simulated = [run.name for run in runs if run.summary.get("simulation")]
    texts = ["Research software, not a medical device."]
    if simulated:
        which = "The X-rays are simulated" if len(simulated) == len(runs) else \
            f"The X-rays of {len(simulated)} of {len(runs)} runs of registrations are simulated"
        names = f" ({', '.join(simulated)})" if len(simulated) < len(runs) and len(simulated) <= 4 else ""
        texts.insert(0, Markup('%s%s, with effects that neither fields nor ray casting model (<a href="#xrays">how</a>). Real X-rays hold '
                               "more: motion, devices, calibration errors.") % (strong(which), names))
    return texts


def provenance(runs):
    blocks = []
    for run in runs:
        found = run.summary["provenance"]
        host, link = found["host"], run.link("reproduce.sh")
        hashes = Markup("<br>").join(Markup('%s <span class="hash">%s</span>') % pair for pair in found["input_sha256"].items())
        blocks += [heading(f"{TITLES[run.kind]}: {run.name}"), Terms([
            ("Program", f"{found['program']} {found['program_version']}, commit {found['program_commit']}"),
            ("Started (UTC)", found["started_utc"]),
            ("Compiler, processor", f"{found['compiler']}, {host['cpu']} ({whole(host['vector_bits'])}-bit vectors)"),
            ("Ranks", whole(found["rank_count"])), ("Seed", whole(found["seed"])), ("Inputs, SHA-256", hashes or "–"),
            ("Script that repeats it", Markup('<a href="%s">%s</a>') % (link, link))]),
            Text(found["command_line"], "pre"), Text(found["options_toml"], "pre")]
    return Section("provenance", "Provenance", blocks)
