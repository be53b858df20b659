"""What a record says: which of the hidden causes were named, and whether one cause was claimed."""

from hil.validation.blind_trials.isolation import probabilities
from hil.validation.blind_trials.metrics import Record
from plant.injection.theta import THETA

_LISTED = frozenset(effect.name for effect in THETA.effects)


def hidden_names(record: Record) -> set[str]:
    """Names of what was hidden."""
    return {cause["effect"] for cause in record["hidden"]}


def answers(record: Record) -> bool:
    """Whether anything at all is called wrong."""
    return bool(record["causes"])


def is_top(record: Record) -> bool:
    """Whether the first named effect is the hidden one."""
    return bool(record["named"]) and record["named"][0] == record["hidden"][0]["effect"]


def is_exact(record: Record) -> bool:
    """Whether all that was hidden is named, and nothing else."""
    return set(record["named"]) == hidden_names(record)


def is_found(record: Record) -> bool:
    """Whether the hidden effect is among the named ones."""
    return record["hidden"][0]["effect"] in record["named"]


def in_set(record: Record) -> bool:
    """Whether the hidden effect is among the named ones and their rivals."""
    return record["hidden"][0]["effect"] in {*record["named"], *record["rivals"]}


def isolation_probability(record: Record) -> float:
    """Probability of the hidden effect. Older records have none of rivals: there a rival counts as 0."""
    rivals = zip(record["rivals"], record.get("rival_probabilities", ()), strict=False)
    entries = [*record["causes"], *({"effect": name, "probability": chance} for name, chance in rivals)]
    return probabilities(entries).get(record["hidden"][0]["effect"], 0.0)


def claims(record: Record) -> bool:
    """Whether a cause is claimed, not a set of which one may be true."""
    return record["verdict"] in ("named", "unlisted")


def right_injection_point(record: Record) -> bool:
    """Whether the first cause acts where the hidden law does."""
    return bool(record["causes"]) and record["causes"][0]["injection_point"] == record["hidden"][0]["injection_point"]


def names_listed_elsewhere(record: Record) -> bool:
    """Whether an effect of the list is claimed that does not act where the hidden law does."""
    joint = record["hidden"][0]["injection_point"]
    return claims(record) and any(c["effect"] in _LISTED and c["injection_point"] != joint for c in record["causes"])


def right_law(record: Record) -> bool:
    """Whether an unlisted cause is answered as one, or by an effect at its injection point."""
    return record["verdict"] == "unlisted" or right_injection_point(record)


def decided(record: Record) -> bool:
    """Whether the manoeuvres that decide, by themselves, give one cause and the right one."""
    then = record["follow_up"]
    return claims(then) and then["named"] == [record["hidden"][0]["effect"]]


def called_not_testable(record: Record) -> bool:
    """Whether the hidden effect is called not testable, and not a cause."""
    effect = record["hidden"][0]["effect"]
    return effect in record["undetectable_effects"] and effect not in record["named"]
