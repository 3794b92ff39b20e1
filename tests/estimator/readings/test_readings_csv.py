import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimator.errors import ReadingsError
from estimator.readings.observation import Observation
from estimator.readings.readings_csv import read, write

HEADER = "angle_deg_a,angle_deg_b,touch_1,touch_2,tilt_lr_deg,tilt_fb_deg,clearance_mm\n"
angle = st.floats(-math.pi, math.pi)
tilt = st.none() | st.floats(-math.pi / 2, math.pi / 2)


@given(
    st.lists(
        st.builds(
            Observation,
            angles=st.tuples(angle, angle),
            touch=st.tuples(st.none() | st.booleans(), st.none() | st.booleans()),
            tilt=st.tuples(tilt, tilt),
            clearance=st.none() | st.floats(-0.01, 0.2),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, observations: list[Observation]
) -> None:
    path = tmp_path_factory.mktemp("csv") / "readings.csv"
    write(path, ["a", "b"], observations)
    table = read(path)
    assert table.joints == ("a", "b")
    for read_back, wanted in zip(table.observations, observations, strict=True):
        assert read_back.angles == pytest.approx(wanted.angles, abs=1e-6)
        assert read_back.touch == wanted.touch
        for one, two in zip(read_back.tilt, wanted.tilt, strict=True):
            assert one == (None if two is None else pytest.approx(two, abs=1e-6))
        height = wanted.clearance
        assert read_back.clearance == (None if height is None else pytest.approx(height, abs=1e-6))


def test_a_table_written_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(
        "angle_deg_hip, touch_1 ,clearance_mm,tilt_fb_deg\n30,1,57.5,-4.5\n\n-15,0,,\n",
        encoding="utf-8-sig",  # as spreadsheets save it
    )
    table = read(path)
    first, second = table.observations
    assert first.angles == pytest.approx([math.radians(30)])
    assert first.touch == (True,)
    assert first.clearance == pytest.approx(0.0575)
    assert first.tilt[0] is None
    assert first.tilt[1] == pytest.approx(math.radians(-4.5))
    assert (second.touch, second.clearance, second.tilt) == ((False,), None, (None, None))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is empty"),
        (HEADER, "has no rows"),
        ("touch_1\n1\n", "no column says what was commanded"),
        ("angle_deg_a\n1\n", "no column says what was felt"),
        (HEADER.replace("tilt_lr_deg", "tilt_lr"), "no column 'tilt_lr'"),
        (HEADER.replace("touch_2", "touch_1") + "1,2,0,0,0,0,0\n", "'touch_1' stands there twice"),
        (HEADER.replace("touch_2", "touch_3") + "1,2,0,0,0,0,0\n", "no column 'touch_3'"),
        (HEADER + "1,2,0,0,0,0\n", "row 1: has 6 cells, and the header has 7"),
        (HEADER + "1,2,0,0,0,0,0\n1,,0,0,0,0,0\n", "row 2: angle_deg_b is empty"),
        (HEADER + "1,x,0,0,0,0,0\n", "row 1: angle_deg_b must be a number or empty, not 'x'"),
        (HEADER + "1,2,2,0,0,0,0\n", "row 1: touch_1 must be 0, 1 or empty, not '2'"),
        (HEADER + "1,2,0,0,91,0,0\n", "row 1: tilt_lr_deg must lie in -90 to 90, not 91"),
        (HEADER + "1,2,0,0,0,nan,0\n", "row 1: tilt_fb_deg must lie in"),
        (HEADER + "1,2,0,0,0,0,1e9\n", "row 1: clearance_mm must lie in"),
        (HEADER + '1,2,0,0,0,0,"3\n', "is no table of comma-separated values"),
        (HEADER.replace(",", ";") + "1,5;2;0;0;0;0;0\n", "are separated by ';': save it with comm"),
        (HEADER.replace(",", "\t") + "1.5\t2\t0\t0\t0\t0\t0\n", "are separated by tabs: save it"),
        (f'\n"{HEADER.strip()}"\r\n'.replace(",", '"|"'), r"are separated by '\|'"),
        ("sep=;\n" + HEADER.replace(",", ";"), "are separated by ';'"),
        (HEADER + '"1,5",2,0,0,0,0,0\n', "must be a number or empty, not '1,5': write a point"),
        (HEADER + "1,5,2,0,0,0,0,0\n", "has 8 cells, .* has 7. Write numbers with points"),
    ],
)
def test_a_wrong_table_is_refused_with_place_and_reason(
    tmp_path: Path, text: str, sentence: str
) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(text)
    with pytest.raises(ReadingsError, match=sentence) as caught:
        read(path)
    assert str(path) in str(caught.value)


def test_a_joints_name_may_hold_any_separator(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text('angle_deg_a;b,"angle_deg_tilt\t|;touch",touch_1\n1,2,1\n')
    assert read(path).joints == ("a;b", "tilt\t|;touch")


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_bytes(b"angle_deg_a,touch_1\n\xff\xfe,1\n")
    with pytest.raises(ReadingsError, match="is no table"):
        read(path)


def test_an_absent_file_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(ReadingsError, match="cannot be read"):
        read(tmp_path / "nowhere.csv")
