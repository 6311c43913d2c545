"""The study of streams that are sent when needed: its cells, by hand, and the section that tells of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from research.paper import claims, sending
from research.paper.page import with_section
from research.paper.sending import Sent, SentNeeded, at_delay, mean_sending, packet_bytes, sending_needed
from research.paper.sending_section import HEADING, in_short, sending_section
from research.paper.streaming import PACKINGS, TWISTS, Packets
from research.paper.streaming.needed import send_when_needed
from research.paper.table import UNIFORM, YARDSTICKS, Point
from rigid_motion.motion import rms
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.research.paper.streaming.motions import swinging


@pytest.fixture
def clip(monkeypatch: pytest.MonkeyPatch) -> Clip:
    monkeypatch.setattr(sending, "DELAYS", (2.0,))
    monkeypatch.setattr(sending, "TOLERANCES", (1.0, 2.5))
    times, poses = swinging(2)
    return Clip("swing", "swing.csv", "blender", times, poses, ())


def cell(
    updates: int, share: float, mode: str = TWISTS, delay: float = 2.0, yardstick: str = "rms_shell_m"
) -> SentNeeded:
    return sending._cell("recordings", updates, mode, delay, yardstick, share, 1, 1)


def test_every_rate_delay_mode_and_tolerance_is_sent_and_as_often_as_was_said(clip: Clip) -> None:
    done = []
    even, sent = sending.measure_sending(clip, lambda: done.append(1))
    assert [round(one.asked) for one in even] == [30, 20, 15, 12]
    assert len(done) == sending.steps_of(clip)
    assert {(one.mode, one.even, one.delay) for one in sent} == {
        (mode, rate, 2.0) for mode in (REFERENCE, TWISTS) for rate in (30, 20, 15, 12)
    }
    assert len(sent) == 2 * 4 * 2
    cells = sending_needed(even, sent)
    twists = [one for one in cells if one.mode == TWISTS and one.yardstick == "rms_shell_m"]
    assert all(0.4 < one.saved < 0.9 for one in twists)


def test_a_stream_is_as_the_receiver_shows_it(clip: Clip) -> None:
    one = sending.stream(clip, TWISTS, 20, 2.0, 0.004)
    packets, _ = send_when_needed(clip.times, clip.poses, 0.004, 0.1)
    assert one.keys_per_s == pytest.approx((len(packets) - 1) / 3.0)
    assert 0.0 < one.rms_shell_m < 0.004
    assert one.rms_shell_m < one.p95_shell_m <= 0.004


def test_silence_costs_heartbeats(clip: Clip) -> None:
    still = replace(clip, poses=clip.poses[[3] * len(clip.times)])
    one = sending.stream(still, TWISTS, 20, 2.0, 0.004)
    assert one.keys_per_s == pytest.approx(6 / 3.0)
    assert one.rms_shell_m < 1e-9


@pytest.mark.parametrize("packing", ["double", "smallest_three"])
def test_bytes_are_those_of_packets(packing: str) -> None:
    times, poses = swinging(1)
    plain = Packets.of(times, poses, 0.1, PACKINGS[packing])
    twisted = Packets.of(times, poses, 0.1, PACKINGS[packing], twists=np.zeros((len(times), 6)))
    assert packet_bytes(packing, REFERENCE) == 28 + plain.data.shape[1]
    assert packet_bytes(packing, TWISTS) == 28 + twisted.data.shape[1]


def test_what_is_needed_is_read_off_the_curve() -> None:
    even = [Point("hand", REFERENCE, UNIFORM, 20.0, 20.0, 0.002, 0.004, 0.1)]
    sent = [
        Sent("hand", TWISTS, 20, 2.0, tolerance, keys, error, 2.0 * error, 0.05)
        for tolerance, keys, error in [(0.002, 16.0, 0.001), (0.008, 4.0, 0.004)]
    ]
    cells = {one.yardstick: one for one in sending_needed(even, sent)}
    # Half-way on a double logarithmic scale.
    assert cells["rms_shell_m"].needed == pytest.approx(8.0)
    assert cells["rms_shell_m"].saved == pytest.approx(0.6)
    assert cells["p95_shell_m"].needed == pytest.approx(8.0)
    assert cells["rms_velocity_m_s"].needed == pytest.approx(4.0)
    assert cells["rms_shell_m"].saved_bytes == pytest.approx(1.0 - 0.4 * (28 + 26 + 104) / (28 + 26 + 56))
    assert cells["rms_shell_m"].saved_small == pytest.approx(1.0 - 0.4 * (28 + 26 + 26) / (28 + 26 + 14))


def test_a_mean_is_geometric_and_over_the_clips_that_reached_it() -> None:
    cells = [
        sending._cell(name, 20, TWISTS, 2.0, "rms_shell_m", share, int(np.isfinite(share)), 1)
        for name, share in (("a", 0.2), ("b", 0.8), ("c", np.inf), ("other", 0.1))
    ]
    (mean,) = mean_sending(cells, "recordings", ["a", "b", "c"])
    assert mean.needed == pytest.approx(8.0)
    assert (mean.reached, mean.asked) == (2, 3)
    assert rms(np.array([mean.saved])) == pytest.approx(0.6)


def test_the_section_says_what_holds_and_what_does_not() -> None:
    shares = {30: 0.6, 20: 0.55, 15: 0.47, 12: 0.2}
    found = [cell(rate, share, yardstick=name) for rate, share in shares.items() for name in YARDSTICKS]
    text = "\n".join(sending_section(found, ["recordings"]))
    assert text.startswith(HEADING)
    assert "| `motor_twists`, 2 intervals | 18.0 (40%) | 11.0 (45%) | 7.0 (53%) | 2.4 (80%) |" in text
    assert "at 2 intervals, 33%, 53% and 58% hold" in text
    assert "at 3 intervals, none holds" in text
    assert "| 1 interval | 33 ms |" in text
    assert "| 2 intervals | 67 ms | 100 ms | 133 ms | 167 ms |" in text
    assert [row.updates for row in at_delay(found, "recordings", TWISTS, 2.0, "rms_shell_m")] == [30, 20, 15, 12]
    (line,) = in_short(found, "recordings")
    assert "40, 45, 53 and 80 % fewer updates" in line
    assert "This reaches the paper's saving at 30, 15 and 12 only." in line
    # 13 numbers instead of 7: a fifth of the updates has 0.37 of the numbers.
    assert "11 % more, 2 % more, 13 % fewer and 63 % fewer numbers (as the paper counts" in line
    assert [row.quality for row in claims.TABLE] == ["Excellent", "Good", "Mediocre", "Poor"]


def test_without_streams_there_is_no_section() -> None:
    assert sending_section([], ["recordings"]) == []
    assert in_short([], "recordings") == []


def test_a_section_goes_where_it_belongs_and_the_page_around_it_stays() -> None:
    page = "# Paper\n\nWords.\n\n## Why a screw wins here and loses there\n\nk\n\n## Bytes\n\nb\n"
    first = with_section(page, f"{HEADING}\n\nOld.\n")
    assert first == page.replace("## Why", f"{HEADING}\n\nOld.\n\n## Why")
    assert with_section(first, f"{HEADING}\n\nNew.\n") == first.replace("Old.", "New.")
