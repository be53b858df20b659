import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from hil.report.report import Panel, Report, Section, Trace
from hil.report.thin import PAGE_SAMPLES, TRACE_SAMPLES, samples_per_trace, thinned

VALUES = hnp.arrays(
    np.float64, st.integers(1, 3000), elements=st.floats(-1e6, 1e6) | st.just(np.nan), fill=st.floats(-1.0, 1.0)
)


@given(VALUES, st.integers(8, 500))
def test_thinning_keeps_extremes_ends_and_gaps_within_the_limit(y: np.ndarray, limit: int) -> None:
    kept = thinned(y, limit)
    assert np.all(np.diff(kept) > 0)
    assert kept[0] == 0
    assert kept[-1] == y.size - 1
    assert kept.size <= max(limit, y.size if y.size <= limit else 0)
    assert np.isnan(y[kept]).any() == np.isnan(y).any()
    if not np.isnan(y).all():
        assert np.nanmin(y[kept]) == np.nanmin(y)
        assert np.nanmax(y[kept]) == np.nanmax(y)


def test_a_single_spike_survives() -> None:
    y = np.zeros(1_000_000)
    y[123_456] = 7.0
    assert y[thinned(y, 100)].max() == 7.0


def _report(traces: int, samples: int) -> Report:
    t_s = np.linspace(0.0, 1.0, samples)
    panel = Panel("p", "", tuple(Trace(str(i), t_s, t_s) for i in range(traces)))
    return Report("r", sections=(Section("s", (panel,)),))


def test_only_large_reports_are_thinned() -> None:
    assert samples_per_trace(_report(60, 1000)) == TRACE_SAMPLES
    assert samples_per_trace(_report(60, 6000)) == PAGE_SAMPLES // 60
    assert samples_per_trace(_report(1000, 500)) == 500
    assert samples_per_trace(Report("nothing")) == TRACE_SAMPLES
