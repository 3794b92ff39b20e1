"""Faults on order: how they are written, when they begin and end."""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot.errors import CommandError
from sim_robot.electronics.dmm32 import DMM32Emulator
from sim_robot.electronics.servos import Servos
from sim_robot.electronics.sv203 import SV203Emulator
from sim_robot.errors import FaultError
from sim_robot.faults.control_socket import FaultClient, FaultSocket, main
from sim_robot.faults.fault_panel import DEVICES, KNOWN, FaultPanel, FaultSpec

ONCE = {
    f"{device}.{name}"
    for device, kind in DEVICES.items()
    for name, fault in kind.FAULTS.items()
    if fault.once
}
SPANS = st.tuples(st.floats(0, 1e6, allow_nan=False), st.sampled_from("si")).map(
    lambda span: f"{span[0]:.3f}{span[1]}"
)


class Panel:
    """Two devices that can fail, and a time that is set by hand."""

    def __init__(self) -> None:
        self.time = 0.0
        self.servos = Servos(8)
        self.daq = DMM32Emulator(lambda channel: 0.0, None)  # type: ignore[arg-type]
        self.panel = FaultPanel({"servos": self.servos, "daq": self.daq}, lambda: self.time)

    def order(self, fault: str) -> None:
        self.panel.order(FaultSpec.parse(fault))

    def advance_to(self, time: float) -> list[str]:
        self.time = time
        self.panel.advance()
        return self.panel.active()


@given(st.sampled_from(sorted(KNOWN)), st.integers(-999, 999), st.none() | SPANS, st.none() | SPANS)
def test_what_is_written_is_read(
    name: str, value: int, start: str | None, duration: str | None
) -> None:
    text = f"{name}={value}{f'@{start}' if start else ''}{f'+{duration}' if duration else ''}"
    if duration is not None and name in ONCE:
        with pytest.raises(FaultError, match="happens once"):
            FaultSpec.parse(text)
        return
    spec = FaultSpec.parse(text)
    assert (spec.name, spec.value) == (name, value)
    assert (spec.start is None, spec.duration is None) == (start is None, duration is None)
    if spec.start is not None and start is not None:
        assert (spec.start.amount, spec.start.unit) == (float(start[:-1]), start[-1])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("daq.stuk_wait", "did you mean daq.stuck_wait"),
        ("engine.fire", "known are"),
        ("daq", "write DEVICE.FAULT"),
        ("daq.absent@soon", "write DEVICE.FAULT"),
        ("daq.absent=x", "write DEVICE.FAULT"),
        ("servo_board.brown_out+3s", "leave out the duration"),
    ],
)
def test_what_cannot_be_is_refused_with_advice(text: str, words: str) -> None:
    with pytest.raises(FaultError, match=words):
        FaultSpec.parse(text)


def test_a_fault_begins_at_once_and_lasts_until_it_is_mended() -> None:
    bench = Panel()
    bench.order("daq.stuck_channel=3")
    assert bench.panel.active() == ["daq.stuck_channel=3"]
    assert bench.advance_to(1e9) == ["daq.stuck_channel=3"]
    bench.panel.mend("servos.dead")
    assert bench.panel.active() == ["daq.stuck_channel=3"]
    bench.panel.mend("daq.stuck_channel")
    assert bench.panel.active() == []


def test_a_fault_keeps_its_hours() -> None:
    bench = Panel()
    bench.order("daq.absent@2s+3s")
    assert bench.panel.waiting() == ["daq.absent@2s+3s"]
    assert bench.advance_to(1.9) == []
    assert bench.advance_to(2.0) == ["daq.absent"]
    assert bench.advance_to(4.9) == ["daq.absent"]
    assert bench.advance_to(5.0) == []


def test_a_fault_keeps_its_interactions() -> None:
    bench = Panel()
    bench.order("servos.dead=2@2i+1i")
    active_faults = []
    for _ in range(4):
        bench.panel.begin_interaction()
        active_faults.append(bench.panel.active())
    assert active_faults == [[], ["servos.dead=2"], [], []]


def test_a_fault_ends_by_the_clock_on_the_wall() -> None:
    bench = Panel()
    bench.order("daq.absent+0.05w")
    deadline = time.monotonic() + 120
    active_faults: list[list[str]] = []
    while (active := bench.panel.active()) or not active_faults:
        active_faults.append(active)
        assert time.monotonic() < deadline
    assert active_faults[0] == ["daq.absent"]
    bench.panel.close()


@pytest.mark.parametrize("first", ["servos.dead=1+5s", "servos.dead=1+5i"])
def test_a_fault_that_takes_the_place_of_another_outlasts_its_end(first: str) -> None:
    bench = Panel()
    bench.order(first)
    bench.order("servos.dead=2")
    for _ in range(5):
        bench.panel.begin_interaction()
    assert bench.advance_to(5.0) == ["servos.dead=2"]


@pytest.mark.parametrize("mended", [False, True])
def test_an_end_on_the_wall_goes_with_its_fault(*, mended: bool) -> None:
    bench = Panel()
    before = threading.enumerate()
    bench.order("servos.dead=3+600w")
    (timer,) = set(threading.enumerate()) - set(before)
    if mended:
        bench.panel.mend("servos.dead")
    bench.order("servos.dead=4")
    timer.join(120.0)
    assert not timer.is_alive()
    assert bench.panel.active() == ["servos.dead=4"]
    bench.panel.close()


def test_mending_all_also_ends_what_has_not_begun() -> None:
    bench = Panel()
    bench.order("daq.absent@5s")
    bench.order("servos.dead=1")
    bench.panel.mend()
    assert bench.panel.waiting() == []
    assert bench.advance_to(10) == []


def test_a_robot_without_the_device_says_so() -> None:
    with pytest.raises(FaultError, match="has no distance"):
        Panel().order("distance.nak")
    with pytest.raises(CommandError, match="the faults here"):
        Servos(8).inject("tired")


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("servos.swapped=8", "swapped needs a number from 1 to 7, not 8"),
        ("servos.dead=9@2i", "dead needs a number from 1 to 8, not 9"),
        ("servos.jammed", "jammed needs a number from 1 to 8, as in jammed=8"),
        ("daq.stuck_channel=77", "stuck_channel needs a number from 0 to 31, not 77"),
        ("daq.absent=2", "absent takes no number; leave out =2"),
    ],
)
def test_a_number_that_nothing_has_is_refused(fault: str, words: str) -> None:
    bench = Panel()
    bench.order("servos.swapped=7")
    with pytest.raises(FaultError, match=words):
        bench.order(fault)
    assert bench.panel.active() == ["servos.swapped=7"]
    assert bench.panel.waiting() == []


def test_a_board_that_is_not_there_browns_out_nowhere() -> None:
    board = SV203Emulator(boards=[2, 7])
    try:
        for number in (0, 2, 7):
            board.inject("brown_out", number)
        with pytest.raises(CommandError, match="one of the numbers 0, 2, 7, not 8"):
            board.inject("brown_out", 8)
    finally:
        board.close()


def test_servos_fail_as_ordered() -> None:
    servos = Servos(8)
    pulses = (10, 20, 30, 40, 50, 60, 70, 80)
    assert servos.carry(pulses) == pulses
    servos.inject("dead", 8)
    servos.inject("swapped", 1)
    servos.inject("jammed", 3)
    assert servos.carry((11, 21, 31, 41, 51, 61, 71, 81)) == (21, 11, 30, 41, 51, 61, 71, 0)
    servos.mend()
    assert servos.carry(pulses) == pulses


def test_a_jam_that_moves_to_another_servo_begins_anew() -> None:
    servos = Servos(4)
    servos.carry((10, 20, 30, 40))
    servos.inject("jammed", 2)
    assert servos.carry((11, 21, 31, 41)) == (11, 20, 31, 41)
    servos.inject("jammed", 4)
    assert servos.carry((12, 22, 32, 42)) == (12, 22, 32, 41)


def test_a_cable_is_a_fault_like_others() -> None:
    board = SV203Emulator()
    try:
        board.inject("unplugged")
        assert not Path(board.port).exists()
        board.mend("drop")
        assert not Path(board.port).exists()
        board.mend("unplugged")
        assert Path(board.port).exists()
    finally:
        board.close()


def test_the_control_socket_does_as_it_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bench = Panel()
    uri = f"ipc://{tmp_path}/faults"
    with FaultSocket(bench.panel, uri, report=lambda: {"more": 1}) as control:
        client = FaultClient(control.endpoint)
        assert client.inject("daq.absent")["active"] == ["daq.absent"]
        assert client.report() == {
            "active": ["daq.absent"],
            "waiting": [],
            "interactions": 0,
            "more": 1,
        }
        assert client.mend()["active"] == []
        with pytest.raises(FaultError, match="did you mean daq"):
            client.inject("daq.absnt")
        with pytest.raises(FaultError, match="has no distance"):
            client.inject("distance.nak")
        assert main([uri, "inject", "servos.dead=1"]) == 0
        assert json.loads(capsys.readouterr().out)["active"] == ["servos.dead=1"]
        assert main([uri, "mend", "servos.nothing"]) == 1
        assert "There is no fault" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert main([uri, "report"]) == 1
    assert f"No simulated robot answers at {uri}" in capsys.readouterr().err


def test_a_killed_robot_leaves_a_socket_that_the_next_one_takes(tmp_path: Path) -> None:
    place = tmp_path / "faults"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(place))
    with FaultSocket(Panel().panel, f"ipc://{place}") as control:
        assert FaultClient(control.endpoint).report()["active"] == []
    place.write_text("somebody's file")
    with pytest.raises(FaultError, match="in use"):
        FaultSocket(Panel().panel, f"ipc://{place}")
    assert place.read_text() == "somebody's file"


NONSENSE = [
    *(b"", b"{", b"[]", b"7", b'{"do": "inject"}', b'{"do": 1}', b"\xff", b"[" * 60_000),
    b"\xff" + bytes(8) + b"\x7f\x03",  # ZeroMQ
    b"x" * 100_000,
]


@pytest.mark.parametrize("nonsense", NONSENSE, ids=lambda nonsense: repr(nonsense[:10]))
def test_the_control_socket_survives_nonsense(nonsense: bytes) -> None:
    bench = Panel()
    with FaultSocket(bench.panel, "tcp://127.0.0.1:*") as control:
        port = int(control.endpoint.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=120.0) as stranger:
            stranger.sendall(nonsense + b"\n")
            with suppress(ConnectionResetError), stranger.makefile("rb") as stream:
                assert json.loads(stream.readline())["ok"] is False
        assert FaultClient(control.endpoint).report()["active"] == []


def test_the_control_socket_waits_for_nobody() -> None:
    with ExitStack() as stack, FaultSocket(Panel().panel, "tcp://127.0.0.1:*") as control:
        port = int(control.endpoint.rpartition(":")[2])
        for _ in range(129):
            slow = stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            slow.sendall(b'{"do": ')
        begun = time.monotonic()
        assert FaultClient(control.endpoint).report()["active"] == []
        assert time.monotonic() - begun < 1.0
        slow.sendall(b'"report"}\n')  # one that was slow is served, too
        with slow.makefile("rb") as stream:
            assert json.loads(stream.readline())["ok"] is True


@pytest.mark.parametrize(
    "uri", ["tcp://0.0.0.0:5999", "tcp://192.0.2.1:1", "ipc:///no/such/folder/x"]
)
def test_the_control_socket_is_for_this_computer_alone(uri: str) -> None:
    with pytest.raises(FaultError, match=r"Other computers|Cannot serve"):
        FaultSocket(Panel().panel, uri)
