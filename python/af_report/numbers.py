# SPDX-License-Identifier: Apache-2.0
"""Numbers for people: three significant digits, and a dash for what is not known."""
import math

NO_BREAK = "\u00a0"


def as_number(value):
    """A float. NaN for null and for what is not a number. summary.json writes an infinity as a text."""
    if value == "inf":
        return math.inf
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan


def three(value):
    """0.268, 12.3, 103 or 1240. A dash for what is not known."""
    value = as_number(value)
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞"
    value = float(f"{value:.3g}")
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    return f"{value:.0f}" if size >= 2 else f"{value:.{2 - size}f}" if size >= -4 else f"{value:.2e}"


def whole(value):
    """A count, or a number as it stands: 16 or 2.5."""
    value = as_number(value)
    return "–" if math.isnan(value) else f"{value:g}" if abs(value) < 1e6 else f"{value:.0f}"


def percent(share):
    """Three digits. Rounding never hides a failure or a success."""
    value = 100 * as_number(share)
    if not math.isfinite(value):
        return "–"
    if 99.95 <= value < 100:
        return f"> 99.9{NO_BREAK}%"
    text = "100" if value == 100 else three(value)
    return f"{text}{NO_BREAK}%"


def interval(proportion):
    low, high = (100 * as_number(proportion[key]) for key in ("wilson_low", "wilson_high"))
    return f"{low:.0f}–{high:.0f}{NO_BREAK}%"


def rate(proportion):
    """93.8 % (72–99 %), by Wilson."""
    if math.isnan(as_number(proportion["rate"])):
        return "–"
    return f"{percent(proportion['rate'])} ({interval(proportion)})"


def milliseconds(seconds):
    return three(1000 * as_number(seconds))


def time(seconds):
    seconds = as_number(seconds)
    if not math.isfinite(seconds):
        return "–"
    return f"{three(1000 * seconds)}{NO_BREAK}ms" if seconds < 1 else f"{three(seconds)}{NO_BREAK}s"


def capture(found):
    """A capture range: none, 6.00 mm, at least 8.00 mm."""
    if not isinstance(found, dict) or not as_number(found["initial_tre_mm"]) > 0:
        return "none"
    return f"{'at least ' if found['is_whole_study'] else ''}{three(found['initial_tre_mm'])} mm"


def counted(count, singular, plural):
    return f"{whole(count)} {singular if count == 1 else plural}"
