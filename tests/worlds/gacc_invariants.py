"""Invariants of every recorded epoch of the gathering world, for any team."""

import numpy as np

LYING, GRIPPED, CARRIED, WAITING, HELPED, DELIVERED, DROPPED = range(7)
UNDETECTED = 2**31 - 1


def is_home(x, y, half):
    """Whether places lie in the home area, in float32."""
    middle = np.float32(0.5)
    return (np.abs(x - middle) <= half) & (np.abs(y - middle) <= half)


def within(scenarios, x, y, e=0):
    """Whether places lie in one of a scenario's obstacles."""
    s = scenarios
    x, y = x[..., None], y[..., None]
    inside_x = (x >= s.left[e]) & (x <= s.right[e])
    return (inside_x & (y >= s.bottom[e]) & (y <= s.top[e])).any(axis=-1)


def check_epoch(a_world, scenarios, seen):
    """Assert everything below of a record."""
    check_places(a_world, scenarios, seen)
    check_lives(a_world, scenarios, seen)
    check_deliveries(a_world, scenarios, seen)
    check_accounts(a_world, scenarios, seen)


def check_places(a_world, scenarios, seen):
    """Everything is in the square and outside obstacles; objects move only with their holders."""
    p, s = a_world.params, scenarios
    for x, y in (("x", "y"), ("object_x", "object_y")):
        assert seen[x].min() >= 0
        assert seen[y].min() >= 0
        assert seen[x].max() < 1
        assert seen[y].max() < 1
        assert not within(s, seen[x], seen[y]).any()
    for t in range(0, a_world.params.iterations, 10):
        x, y = seen["x"][t].astype(float), seen["y"][t].astype(float)
        gaps = np.hypot(x[:, None] - x, y[:, None] - y) + np.eye(len(x))
        assert gaps.min() >= p.separation * (1 - 1e-4)
    at = {
        x: np.concatenate([start, seen[x]])
        for x, start in (("x", s.start_x), ("y", s.start_y),
                         ("object_x", s.object_x), ("object_y", s.object_y))
    }  # fmt: skip
    steps = np.hypot(np.diff(at["x"], axis=0), np.diff(at["y"], axis=0))
    assert steps.max() <= p.move_range * (1 + 1e-4)
    assert not steps[seen["action"] != 3].any()
    # An object moves with its only holder, to the holder's place, or to its place in the zone.
    moved = (np.diff(at["object_x"], axis=0) != 0) | (np.diff(at["object_y"], axis=0) != 0)
    for t, k in zip(*np.nonzero(moved), strict=True):
        if seen["life"][t, k] == DELIVERED:
            continue
        (i,) = np.flatnonzero(seen["held"][t - 1] == k)
        assert steps[t, i] > 0
        assert seen["object_x"][t, k] == seen["x"][t, i]
        assert seen["object_y"][t, k] == seen["y"][t, i]
    # Its holder never moves without it.
    for t, i in zip(*np.nonzero(steps[1:] > 0), strict=True):
        k = seen["held"][t, i]
        assert k < 0 or moved[t + 1, k]


def check_lives(a_world, scenarios, seen):
    """The objects held by robots agree with the recorded states of the objects."""
    half = np.float32(a_world.params.home_side / 2)
    held, life = seen["held"], seen["life"]
    n_objects = life.shape[1]
    assert held.min() >= -1
    assert held.max() < n_objects
    holders = (held[:, :, None] == np.arange(n_objects)).sum(axis=1)
    home = is_home(seen["object_x"], seen["object_y"], half)
    assert (holders[~home] <= 1).all()
    assert np.array_equal(np.isin(life, (GRIPPED, CARRIED)), (holders == 1) & ~home)
    assert np.array_equal(life == WAITING, (holders == 1) & home)
    assert np.array_equal(life == HELPED, holders > 1)
    assert np.array_equal(life == DELIVERED, seen["part"] >= 0)
    before = np.concatenate([np.zeros((1, n_objects), life.dtype), life[:-1]])
    assert (life[before == DELIVERED] == DELIVERED).all()
    assert (before[life == LYING] == LYING).all()
    assert np.isin(before[life == CARRIED], (GRIPPED, CARRIED)).all()
    # At home a robot with an object does not move and waits, with the fitting grip.
    at_home = is_home(seen["x"], seen["y"], half)
    waits = (held[:-1] >= 0) & at_home[:-1] & (seen["energy"][:-1] > 0)
    assert np.isin(seen["situation"][1:][waits], (2, 4)).all()
    kinds = scenarios.object_type[0][held[:-1]]
    assert np.array_equal(seen["action"][1:][waits], 4 + kinds[waits])
    assert (seen["waited"] < a_world.params.wait).all()
    assert not seen["waited"][held < 0].any()
    assert (held[seen["energy"] <= 0] == -1).all()
    found = np.minimum.accumulate(seen["detected"], axis=0)
    assert np.array_equal(found, seen["detected"])
    first = np.arange(len(found))[:, None]
    assert ((found <= first) | (found == UNDETECTED)).all()
    if a_world.params.needs_detection:
        assert (found[1:][holders[1:] > 0] < np.nonzero(holders[1:] > 0)[0] + 1).all()


def check_deliveries(a_world, scenarios, seen):
    """Deliveries follow the plans, and only they are rewarded."""
    part, kinds = seen["part"], scenarios.object_type[0]
    final = part[-1]
    delivered = final[final >= 0]
    assert len(set(delivered.tolist())) == len(delivered)
    for c, (plan, ordered) in enumerate(zip(scenarios.plan, a_world.plan.is_ordered, strict=True)):
        steps = {int(final[k]) - 10 * c: int(kinds[k]) for k in np.flatnonzero(final // 10 == c)}
        assert sorted(steps) == list(range(len(steps)))
        types = [steps[n] for n in range(len(steps))]
        if ordered:
            assert types == plan[: len(types)].tolist()
        else:
            plans, got = (np.bincount(v, minlength=3) for v in (plan, np.array(types, int)))
            assert (got <= plans).all()
    gained = np.diff(seen["fitness"], axis=0, prepend=0)
    assert np.isin(gained, (0, 1)).all()
    new = np.diff((part >= 0).astype(int), axis=0, prepend=0)
    assert new.min() >= 0
    for t in range(len(new)):
        now = np.flatnonzero(new[t])
        assert gained[t].sum() >= (2 + kinds[now]).sum()
        if not len(now):
            assert not gained[t].any()
        elif t:
            # All previous holders of one of them that are alive are rewarded.
            before = np.isin(seen["held"][t - 1], now) & (seen["energy"][t] > 0)
            assert (gained[t][before] == 1).all()
            assert (seen["held"][t][gained[t] == 1] == -1).all()
    when = {int(final[k]): int((part[:, k] >= 0).argmax()) for k in np.flatnonzero(final >= 0)}
    assert all(when[n - 1] <= at for n, at in when.items() if n % 10)


def check_accounts(a_world, scenarios, seen):
    """Every executed action is counted in one column, and costs energy."""
    r = a_world.n_robots
    counts = seen["counts"]
    assert counts.min() >= 0
    action, p = seen["action"], a_world.params
    assert np.array_equal(counts.sum(axis=2), np.cumsum(action >= 0, axis=0))
    for a in range(3):
        assert np.array_equal(counts[:, :, a], np.cumsum(action == a, axis=0))
    moves = np.cumsum(action == 3, axis=0)
    assert (counts[:, :, 3] <= moves).all()
    assert np.array_equal(counts[:, :, 7:].sum(axis=2) > 0, seen["fitness"] > 0)
    price = np.array([*[p.object_cost] * 3, p.move_cost, *[p.grip_cost] * 3]) + p.robot_cost
    paid = np.cumsum(np.where(action >= 0, price[action], 0.0), axis=0)
    assert np.abs(p.energy - paid - seen["energy"]).max() < 2e-4 * len(paid)
    energy = np.concatenate([np.full((1, r), p.energy), seen["energy"][:-1]])
    assert np.array_equal(energy > 0, action >= 0)
