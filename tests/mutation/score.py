"""How many mutants of a sample the tests kill, with what is known of the survivors."""
import collections
import math

from keys import key

# `mutants` were tried, of the `all` that there are. `equal` ones no test can notice; they do not count in the score, which is between `low` and
# `high` with a probability of 95 %.
Score = collections.namedtuple("Score", "all mutants killed equal low high")


def wilson(killed, tried):
    """The 95 % interval of a share by E. B. Wilson, 1927: of use for small samples, and near 0 and 1."""
    if tried == 0:
        return 0.0, 1.0
    z, share = 1.959964, killed / tried
    middle = share + z * z / (2 * tried)
    half = z * math.sqrt(share * (1 - share) / tried + z * z / (4 * tried * tried))
    scale = 1 + z * z / tried
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def reasons_by_key(survivors):
    """survivors.json: [{file, change, text, ordinal (1 if absent), equal (true: no test can notice it), reason}], by key."""
    return {key(entry): entry for entry in survivors or []}


def scores(mutants, existing, survivors):
    """{folder: Score}, and that of "all". `mutants` are results of run_mutants.py, `existing` says how many mutants each folder has."""
    reasons = reasons_by_key(survivors)
    tried, killed, equal = collections.Counter(), collections.Counter(), collections.Counter()
    for mutant in mutants:
        for name in (mutant["folder"], "all"):
            tried[name] += 1
            killed[name] += mutant["by"] is not None
            equal[name] += mutant["by"] is None and bool(reasons.get(key(mutant), {}).get("equal"))
    existing = {**existing, "all": sum(existing.get(folder, 0) for folder in tried if folder != "all")}
    folders = [*sorted(folder for folder in tried if folder != "all"), "all"]
    return {name: Score(existing.get(name, tried[name]), tried[name], killed[name], equal[name], *wilson(killed[name], tried[name] - equal[name]))
            for name in folders}


def share(score):
    """The score in words: 85 % (70 to 93)."""
    counted = score.mutants - score.equal
    return f"{score.killed / counted:.0%} ({100 * score.low:.0f} to {100 * score.high:.0f})" if counted else "none"
