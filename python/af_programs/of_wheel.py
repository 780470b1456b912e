# SPDX-License-Identifier: Apache-2.0
"""Starts af-convert and af-report where a wheel brought them, perhaps without the modules that only they need."""
import importlib
import sys


def started(program: str, modules: str) -> int:
    try:
        main = importlib.import_module(modules + ".program").main
    except ModuleNotFoundError as error:
        print(f"{program}: needs the Python module {error.name}: pip install 'attenuation-fields[programs]'", file=sys.stderr)
        return 1
    return main()


def convert() -> int:
    return started("af-convert", "af_convert")


def report() -> int:
    return started("af-report", "af_report")
