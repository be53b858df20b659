"""The answer in one or two sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from hil.diagnosis.result.goodness_of_fit import ChannelFit
from hil.diagnosis.result.moved_numbers import MovedNumber, Value
from hil.diagnosis.result.phrases import sentence

_OTHERS = {
    "not_testable": "These manoeuvres excite too little to conclude anything.",
    "unlisted": "No listed cause explains the data.",
}
_UNCHANGED = "No change since the reference beyond noise and what differs from day to day."
_MOST_RIVALS, _MOST_NUMBERS = 3, 3


def headline(
    verdict: str, causes: Sequence[Mapping[str, Any]], rivals: Sequence[Mapping[str, Any]],
    moved: Sequence[MovedNumber], since_reference: bool = False,
) -> str:  # fmt: skip
    """What is wrong, where, by how much and from when on, and what these logs cannot tell it from; else that nothing
    is, and with which numbers of the car; or what has changed since the reference."""
    if verdict == "none":
        return _UNCHANGED if since_reference else _nothing(moved)
    each = [sentence(cause) for cause in causes]
    if since_reference and each:
        each[0] = f"Changed since the reference: {_lower(each[0])}"
    sentences = [f"{'; '.join(each)}."] if causes else []
    if verdict in _OTHERS:
        sentences.append(_OTHERS[verdict])
    elif not causes:
        sentences.append(f"{verdict.replace('_', ' ').capitalize()}.")
    if verdict == "cannot_tell_apart" and rivals:
        others = list(dict.fromkeys(_lower(sentence(rival, interval=False)) for rival in _by_effect(rivals)))
        more = len(others) - _MOST_RIVALS
        listed = "; ".join(others[:_MOST_RIVALS]) + (f"; and {more} more" if more > 0 else "")
        sentences.append(f"These logs cannot tell {'that' if len(causes) == 1 else 'these'} from: {listed}.")
    return " ".join(sentences)


def not_described(misfits: Sequence[ChannelFit], rivals: Sequence[Mapping[str, Any]]) -> str:
    """That the model does not describe the car: in which channel, by how much, where; and what comes nearest."""
    worst = max(misfits, key=lambda one: one.unexplained)
    since_s, until_s = worst.worst_s
    misfit = (
        f"The model does not describe this car: {worst.channel.replace('_', ' ')} is off by "
        f"{short_text(worst.error)} {worst.unit}, {100.0 * worst.unexplained:.0f} % of what it does, most in "
        f"{worst.worst_log} from {since_s:.1f} to {until_s:.1f} s."
    )
    nearest = "; ".join(_lower(sentence(one, interval=False)) for one in _by_effect(rivals)[:_MOST_RIVALS])
    return f"{misfit} Nearest of what was tried, no cause: {nearest}." if nearest else misfit


def _by_effect(rivals: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The most probable rival of each effect."""
    best: dict[str, Mapping[str, Any]] = {}
    for rival in sorted(rivals, key=lambda one: -one["probability"]):
        best.setdefault(rival["effect"], rival)
    return list(best.values())


def _lower(text: str) -> str:
    return text[0].lower() + text[1:]


def _nothing(moved: Sequence[MovedNumber]) -> str:
    beyond = [one for one in moved if one.beyond_tolerance]
    if beyond:
        return f"No cause beyond noise, with numbers moved beyond their stated tolerance: {_numbers(beyond)}."
    unstated = [one for one in moved if one.moved_unstated]
    if unstated:
        listed = _numbers(unstated)
        return f"Nothing beyond noise and the stated tolerances, with numbers moved that are not stated: {listed}."
    return "Nothing beyond noise and the stated tolerances."


def _numbers(moved: Sequence[MovedNumber]) -> str:
    shown = [
        f"{one.words} from {value_text(one.nominal)} to {value_text(one.estimate)} {one.quantity.unit}".rstrip()
        for one in moved[:_MOST_NUMBERS]
    ]
    more = len(moved) - _MOST_NUMBERS
    return "; ".join(shown) + (f"; and {more} more" if more > 0 else "")


def value_text(value: Value) -> str:
    """A number, or one for each axle, to three digits and without an exponent where it is short."""
    return ", ".join(short_text(one) for one in (value if isinstance(value, list) else [value]))


def short_text(value: float, digits: int = 3) -> str:
    """A number to so many digits."""
    return f"{float(f'{value:.{digits}g}'):.8g}"
