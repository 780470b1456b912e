#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Joins the sections of a benchmark: benchmark.json with what a model of scaling needs, tables (.md), and one number per line (.csv).

Usage: report.py FOLDER COMMIT COMMAND      FOLDER holds sections/*.json"""
import csv
import json
import os
import sys
from pathlib import Path

PHASES = ("read", "resample", "cast", "train", "fit filter", "encode", "write")


def table(title, columns, rows):
    lines = [columns, *rows]
    text = [f"| {' | '.join(map(str, line))} |\n" for line in lines]
    text.insert(1, "|---|" + "---:|" * (len(columns) - 1) + "\n")
    return (f"## {title}\n\n" if title else "\n") + "".join(text)


def number(value, form=".3g"):
    return format(value, form)


def ratios(found):
    return table("", ["times as fast per unit of work", "medians", "minima"], [
        [f"{ratio['faster']} against {ratio['than']}", number(ratio["by_median"]), number(ratio["by_minimum"])] for ratio in found])


def machine(section):
    return table("Machine, one core", ["", "10^9 per second"], [
        [f"{name} ({result['unit']})", number(result["per_second"] / 1e9)] for name, result in section["results"].items()])


def casting(section):
    rows = [[name, number(result["per_second"] / 1e6), *(number(result["seconds"][which] * 65536e3 / result["work"]) for which in ("median", "min"))]
            for name, result in section["results"].items()]
    agreement = [[name, number(found["factor"]), number(found["psnr_db"], ".1f")] for name, found in section["agreement_with_reference"].items()]
    return (table("Casting, one core", ["caster", "million rays/s", "ms per 65536 rays", "least ms"], rows) + ratios(section["ratios"]) +
            table("", ["same image as the reference caster", "factor", "PSNR dB"], agreement))


def encoding(section):
    rows, found, text = [], [], ""
    for codebook in section["codebooks"]:
        size = codebook["codewords"]
        rows += [[name, size, number(result["per_second"] / 1e3), number(1e6 / result["per_second"])] for name, result in codebook["results"].items()]
        found += [{**ratio, "than": f"{ratio['than']}, {size} codewords"} for ratio in codebook["ratios"]]
        faiss = codebook.get("faiss_answers_other_than_brute_force")
        text += (f"\n{codebook['answers_other_than_brute_force']} of {codebook['answers_compared']} answers differ from brute force with {size} "
                 f"codewords{'' if faiss is None else f' (Faiss: {faiss})'}.\n")
    blas = f"\nBLAS under Faiss: {os.path.basename(section['blas'])}\n" if section["blas"] else ""
    return table("Encoding, one core", ["search", "codewords", "thousand tiles/s", "us per tile"], rows) + ratios(found) + text + blas


def drrs(title):
    return lambda section: table(title, ["renderer", "ms", "least ms"], [
        [name, *(number(result["seconds"][which] * 1e3 / result["work"]) for which in ("median", "min"))]
        for name, result in section["results"].items()]) + ratios(section["ratios"])


def phases(jobs, title):
    rows = []
    for job in jobs:
        seconds, total = [job["phase_seconds"].get(phase, 0) for phase in PHASES], job["seconds"]["median"]
        rows.append([job["name"], job["ranks"], number(total), number(total - sum(seconds)), *map(number, seconds)])
    return table(title, ["field", "ranks", "total", "start and end", *PHASES], rows)


def fields(sections):
    def job_named(section, name):
        return next((job for job in sections.get(section, {}).get("jobs", []) if job["name"] == name), None)

    rows = []
    for job in sections["fields"]["jobs"]:
        memory, quality = job_named("memory", job["name"]), job_named("quality", job["name"])
        rows.append([job["name"], number(job["seconds"]["median"]), number(memory["peak_node_mb"], ".0f") if memory else "", number(job["file_mb"]),
                     number(job["payload_mb"]), *(number(quality["psnr_db"][which], ".1f") if quality else "" for which in ("median", "p5", "min"))])
    return table("Whole fields, 2 ranks", ["field", "s", "peak MB", "file MB", "payload MB", "median dB", "5 % dB", "least dB"], rows) + "\n" + phases(
        sections["fields"]["jobs"], "Seconds per phase, 2 ranks")


def efficiency(section):
    alone, cores, rows = section["jobs"][0], section["machine"]["cores"], []
    for job in section["jobs"]:
        used = min(job["ranks"], cores)
        rows.append([f"{job['ranks']}{' (more ranks than cores)' if job['ranks'] > cores else ''}", used,
                     number(alone["seconds"]["median"] / (used * job["seconds"]["median"]), ".2f"),
                     *(number(alone["phase_seconds"][phase] / (used * job["phase_seconds"][phase]), ".2f") for phase in ("cast", "train", "encode"))])
    return phases(section["jobs"], "The same field on 1, 2 and 4 ranks, seconds") + table(
        "", ["ranks", "cores", "efficiency of the job", "of casting", "of training", "of encoding"], rows)


def model_inputs(sections):
    inputs = {}
    if "casting" in sections:
        inputs.update(units_of_one_rank=sections["casting"]["units"], resample_seconds_one_core=sections["casting"]["resample_seconds"])
    for job in [job for name in ("fields", "efficiency") for job in sections.get(name, {}).get("jobs", [])]:
        inputs.setdefault("phase_seconds", {})[job["name"]] = {
            **{key: job[key] for key in ("ranks", "training_iterations", "training_tiles", "tiles_not_empty", "rays_cast")},
            "seconds": job["phase_seconds"], "wall_seconds": job["seconds"]["median"],
            # Element sums and counts of every codeword, and two errors.
            "bytes_reduced_per_iteration": (job["codewords"] * 17 + 2) * 8,
            "payload_bytes": job["payload_mb"] * 1e6, "file_bytes": job["file_mb"] * 1e6}
    between = {name: section for name, section in sections.items() if name.startswith("ranks-")}
    return {**inputs, "between_ranks": between} if between else inputs


def numbers(sections):
    """(section, name, quantity, value, CT, commit) of what was measured."""
    for name, section in sections.items():
        origin = [section.get("case", {}).get("ct_content_sha256", "")[:16], section.get("commit", "unknown")]
        found = []
        for job in section.get("jobs", []):
            found += [(job["name"], "median s", job["seconds"]["median"])] if "seconds" in job else []
            found += [(job["name"], size, job[size]) for size in ("file_mb", "payload_mb", "peak_node_mb") if size in job]
            found += [(job["name"], f"median s of {phase}", seconds) for phase, seconds in job.get("phase_seconds", {}).items()]
            found += [(job["name"], f"{which} PSNR dB", job["psnr_db"][which]) for which in ("median", "p5", "min") if "psnr_db" in job]
        timed = [("", section.get("results", {}))]
        timed += [(f", {codebook['codewords']} codewords", codebook["results"]) for codebook in section.get("codebooks", [])]
        for suffix, results in timed:
            for what, result in results.items():
                unit = result["unit"].removesuffix("s")
                found += [(what + suffix, f"{which} us per {unit}", result["seconds"][which] * 1e6 / result["work"]) for which in ("median", "min")]
        found += [(caster, "PSNR dB against RayCaster", agreement["psnr_db"])
                  for caster, agreement in section.get("agreement_with_reference", {}).items()]
        yield from ([name, what, quantity, number(value, ".4g"), *origin] for what, quantity, value in found)


def main(folder, commit, command):
    parts = [json.loads(path.read_text(encoding="utf-8")) for path in sorted((Path(folder) / "sections").glob("*.json"))]
    sections = {part["section"]: part for part in parts}
    result = {"format": "attenuation-fields benchmark", "format_version": 1, "commit": commit, "command": command,
              "machine": next((part["machine"] for part in parts if "machine" in part), {}), "sections": sections,
              "model_inputs": model_inputs(sections)}
    tables = {"casting": casting, "encoding": encoding, "drr-look-up": drrs("One DRR of the paper's field, one core"),
              "drr-standard": drrs("One DRR of the default field, one core"), "python": drrs("One DRR from Python, one core"),
              "fields": lambda _: fields(sections), "efficiency": efficiency, "machine": machine}
    text = "".join(make(sections[name]) + "\n" for name, make in tables.items() if name in sections)
    base = Path(folder) / "benchmark"
    base.with_suffix(".json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    base.with_suffix(".md").write_text(text, encoding="utf-8")
    with base.with_suffix(".csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["section", "name", "quantity", "value", "ct_content_sha256", "commit"])
        writer.writerows(numbers(sections))
    print(f"{text}Wrote {base}.json, {base}.md and {base}.csv")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
