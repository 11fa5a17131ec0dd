"""Which recordings are held out: shares of information against variances computed one by one."""

from types import SimpleNamespace

import numpy as np

from sandbox.gap.posterior.holdout import FELT, Information

SHAPE = (5, 4)  # recordings, coordinates
LABELS = ["a", "b", "c", "d"]
DEVIATION = np.array([1.0, 0.1, 10.0, 1e-6])


def equations(rng):
    """Return random segments, two channels of each recording; one of them feels half of the
    coordinates."""
    segments = []
    for k in range(SHAPE[0]):
        for places in (np.arange(4), np.array([0, 2])):
            j = rng.normal(size=(3, 20, len(places)))
            segments.append(SimpleNamespace(recording=k, places=places, a=j.transpose(0, 2, 1) @ j))
    coordinates = [
        SimpleNamespace(label=n, deviation=d) for n, d in zip(LABELS, DEVIATION, strict=True)
    ]
    return SimpleNamespace(coordinates=coordinates, segments=segments)


def test_shares_are_those_of_variances_with_and_without():
    """numpy's inverses of the matrices of those recordings that stay, added up here."""
    n = equations(np.random.default_rng(1))
    known = Information.of(n)
    # nothing is told of d beyond its prior: 20 samples of slope 1 at a deviation of 1e-6
    assert known.felt(LABELS) == [0, 1, 2]

    def added(kept):
        """Return A of some recordings."""
        a = np.zeros((4, 4))
        for s in n.segments:
            if s.recording in kept:
                for i, x in enumerate(s.places):
                    for j, y in enumerate(s.places):
                        a[x, y] += s.a[:, i, j].sum()
        return a

    prior = np.diag(DEVIATION**-2.0)
    for left in ((0,), (1, 4), (2, 3)):
        whole, kept = added(range(5)), added([k for k in range(5) if k not in left])
        expected = []
        for k in (0, 1, 2):
            fit = np.linalg.inv(whole + prior)[k, k] / np.linalg.inv(kept + prior)[k, k]
            expected.append(min(fit, FELT * (1.0 - kept[k, k] / whole[k, k])))
        np.testing.assert_allclose(known.kept(left, [0, 1, 2]), sorted(expected), atol=1e-9)
    assert known.kept((0,), []) == ()
