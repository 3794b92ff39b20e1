"""Exported bodies, opened by the programs that they are for."""

from __future__ import annotations

import json
import logging
import math
import re
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from estimator.body.morphology import BASE, Base, Morphology, Part, PartShape
from estimator.body.mounts import BaseMount
from estimator.physics.base import WorldSettings
from estimator.physics.pybullet import PyBulletPhysics
from estimator.report.export.description import Description, describe
from estimator.report.export.formats import as_json, mjcf, urdf
from protocol.system.process import native_output_discarded
from protocol.wire.capabilities import Joint
from sim_robot.world.body import load_body
from sim_robot.world.simulation import open_world
from tests.estimator.kinematics import part_frames

with native_output_discarded():
    import pybullet

MakeBody = Callable[[np.random.Generator], Morphology]
JOINTS = tuple(
    Joint(name=f"servo {n}", lower=-1.4, upper=1.3 + n / 100, speed=1.0472, resolution=0.01)
    for n in range(8)
)


def described(body: Morphology) -> Description:
    return describe(
        body,
        robot="tree & co",
        parts=[f"part {row}" for row in range(len(body.parts))],
        carried=[part.motor for part in body.parts],
        joints=JOINTS,
    )


@pytest.fixture(params=["random_tree", "random_tree_of_own_tables"])
def tree(request: pytest.FixtureRequest) -> Morphology:
    make: MakeBody = request.getfixturevalue(request.param)
    return make(np.random.default_rng(0))


def frames(body: Morphology, program: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Place and rotation of each link by name."""
    places, turns = part_frames(body, program)
    return {f"part_{row}": (places[row], turns[row]) for row in range(len(body.parts))}


def test_yourdfpy_finds_each_link_where_it_is(tree: Morphology, tmp_path: Path) -> None:
    import yourdfpy  # takes a second, which other tests need not wait for

    path = tmp_path / "tree.urdf"
    path.write_text(urdf(described(tree)), encoding="utf-8")
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=True, load_meshes=False)
    assert robot.validate()
    program = np.random.default_rng(5).uniform(-1, 1, 8)
    names = {f"servo_{part.motor}": part.motor for part in tree.parts if part.motor is not None}
    assert set(robot.actuated_joint_names) == set(names)
    robot.update_cfg({name: program[motor] for name, motor in names.items()})
    for name, (place, turn) in frames(tree, program).items():
        pose = robot.get_transform(name, "body")
        assert pose[:3, 3] == pytest.approx(place, abs=1e-9)
        assert pose[:3, :3] == pytest.approx(turn, abs=1e-9)
    for name, motor in names.items():
        limit = robot.joint_map[name].limit
        assert (limit.lower, limit.upper) == (JOINTS[motor].lower, JOINTS[motor].upper)
        assert limit.velocity == JOINTS[motor].speed


def test_a_round_main_body_is_a_cylinder(tmp_path: Path) -> None:
    leg = Part(parent=BASE, mount=1, hinge=2, length=0.2, radius=0.006, motor=0)
    base = Base(size=(0.14, 0.14, 0.03), mass=0.4, round=True)
    body = described(Morphology(base=base, parts=(leg,), density=1000.0))
    model = mujoco.MjModel.from_xml_string(mjcf(body))
    plate = next(geom for geom in map(model.geom, range(model.ngeom)) if geom.bodyid[0] == 1)
    assert plate.type[0] == mujoco.mjtGeom.mjGEOM_CYLINDER
    assert plate.size[:2] == pytest.approx((0.07, 0.015))
    given = model.body("body").inertia
    text = mjcf(body).replace("<compiler ", '<compiler inertiafromgeom="true" ')
    density = 0.4 / (math.pi * 0.07**2 * 0.03)
    bare = text.replace('type="cylinder"', f'type="cylinder" density="{density}"')
    assert given == pytest.approx(mujoco.MjModel.from_xml_string(bare).body("body").inertia)
    path = tmp_path / "plate.urdf"
    path.write_text(urdf(body), encoding="utf-8")
    found = load_body(path)
    assert (found.base_radius, found.base_size) == (0.07, (0.14, 0.14, 0.03))
    assert found.notes == ()


def test_a_body_that_stands_starts_on_its_feet() -> None:
    under = BaseMount(name="under", at=(0.0, 0.0, -0.05), yaw=0.0, elevation=-math.pi / 2)
    leg = Part(parent=BASE, mount=0, hinge=2, length=0.2, radius=0.006, motor=0)
    base = Base(size=(0.1, 0.1, 0.1), mass=1.0, mounts=(under,))
    body = Morphology(base=base, parts=(leg,), density=1000.0)
    model = mujoco.MjModel.from_xml_string(mjcf(described(body)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.body("body").xpos[2] == pytest.approx(0.25)
    assert data.sensor("clearance").data[0] == pytest.approx(0.2, abs=2e-4)


def test_a_body_that_lies_on_its_belly_reads_no_clearance(random_quadruped: MakeBody) -> None:
    body = described(random_quadruped(np.random.default_rng(0)))
    model = mujoco.MjModel.from_xml_string(mjcf(body))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, int(1.0 / model.opt.timestep))
    assert data.body("body").xpos[2] == pytest.approx(body.size[2] / 2, abs=1e-4)  # it lies
    assert data.sensor("clearance").data[0] == pytest.approx(0.0, abs=2e-4)


def test_check_urdf_accepts_it(tree: Morphology, tmp_path: Path) -> None:
    path = tmp_path / "tree.urdf"
    path.write_text(urdf(described(tree)), encoding="utf-8")
    ended = subprocess.run(
        ["check_urdf", path], capture_output=True, text=True, check=False, timeout=120
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert "Successfully Parsed XML" in ended.stdout


def test_mujoco_finds_each_link_where_it_is(tree: Morphology) -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(described(tree)))
    data = mujoco.MjData(model)
    program = np.random.default_rng(5).uniform(-1, 1, 8)
    for motor in (part.motor for part in tree.parts if part.motor is not None):
        joint = model.joint(f"servo_{motor}")
        data.qpos[joint.qposadr[0]] = program[motor]
        assert joint.range == pytest.approx((JOINTS[motor].lower, JOINTS[motor].upper))
    mujoco.mj_kinematics(model, data)
    lift = data.body("body").xpos
    for row, (name, (place, turn)) in enumerate(frames(tree, program).items()):
        assert data.body(name).xpos - lift == pytest.approx(place, abs=1e-6)
        assert data.body(name).xmat.reshape(3, 3) == pytest.approx(turn, abs=1e-6)
        assert model.body(name).mass[0] == pytest.approx(tree.masses[row])
    assert model.body_mass.sum() == pytest.approx(tree.mass)
    assert lift[2] == pytest.approx(tree.planar_height)
    sensors = [model.sensor(number).name for number in range(model.nsensor)]
    assert sensors == ["tilt", "clearance", "touch_1", "touch_2", "touch_3", "touch_4"]


@pytest.mark.parametrize("shape", ["capsule", "box"])
def test_mujocos_own_inertia_of_a_part_is_ours(shape: PartShape) -> None:
    for length in (0.2, 0.02, 0.004):
        limb = Part(
            parent=BASE, mount=1, hinge=2, length=length, radius=0.013, motor=0, shape=shape
        )
        body = Morphology(base=Base(size=(0.1,) * 3, mass=1.0), parts=(limb,), density=900.0)
        text = mjcf(described(body))
        given = mujoco.MjModel.from_xml_string(text).body("part_0").inertia
        ours = '<compiler inertiafromgeom="true" '
        bare = text.replace("<compiler ", ours).replace("<geom ", '<geom density="900" ')
        computed = mujoco.MjModel.from_xml_string(bare).body("part_0").inertia
        assert sorted(given) == pytest.approx(sorted(computed), rel=1e-6)


def test_pybullet_takes_masses_inertia_and_limits(tree: Morphology, tmp_path: Path) -> None:
    body = described(tree)
    path = tmp_path / "tree.urdf"
    path.write_text(urdf(body), encoding="utf-8")
    with native_output_discarded():
        client = pybullet.connect(pybullet.DIRECT)
        robot = pybullet.loadURDF(
            str(path),
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE | pybullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
    try:
        links = {link.name: link for link in body.links}
        for index in range(pybullet.getNumJoints(robot, physicsClientId=client)):
            info = pybullet.getJointInfo(robot, index, physicsClientId=client)
            link = links[info[12].decode()]
            dynamics = pybullet.getDynamicsInfo(robot, index, physicsClientId=client)
            assert info[1].decode() == link.joint.name
            assert dynamics[0] == pytest.approx(link.mass)
            assert dynamics[2] == pytest.approx(link.inertia)
            if link.joint.limits is not None:
                assert info[8:10] == pytest.approx(
                    (link.joint.limits.lower, link.joint.limits.upper)
                )
    finally:
        pybullet.disconnect(client)


def test_dropped_in_the_simulators_world_it_reads_what_the_model_reads(
    random_quadruped: MakeBody, tmp_path: Path
) -> None:
    path, rng = tmp_path / "body.urdf", np.random.default_rng(11)
    step = 1 / 240
    with PyBulletPhysics(WorldSettings(step=step, steps=1200)) as physics:
        for _ in range(3):
            body = random_quadruped(rng)
            bars = [replace(part, shape="box") for part in body.parts[:4]]
            body = replace(body, parts=(*bars, *body.parts[4:]))
            program = rng.uniform(-0.5, 0.5, 4)
            path.write_text(urdf(described(body)), encoding="utf-8")
            read = physics.read([(body, program)])
            with open_world(load_body(path), log=logging.getLogger("world")) as world:
                world.set_targets(program.tolist())
                world.advance_to(1200 * step)
                x, y, _ = world.up()
                tilt = np.degrees([math.asin(y), math.asin(x)])
                assert tilt == pytest.approx(np.degrees(read.tilt[0]), abs=0.1)
                assert world.belly_ray() == pytest.approx(read.clearance[0], abs=3e-4)
                assert (np.array(world.gaps()) < 1e-3).tolist() == read.touch[0].tolist()


def test_what_is_seen_is_what_touches(tree: Morphology) -> None:
    for link in ElementTree.fromstring(urdf(described(tree))).iterfind("link"):
        seen, touches = link.findall("visual"), link.findall("collision")
        assert touches
        for visual, collision in zip(seen, touches, strict=True):
            (material,) = visual.findall("material")
            visual.remove(material)
            visual.tag, visual.tail = "collision", collision.tail
            visual[-1].tail = collision[-1].tail
            assert ElementTree.tostring(visual) == ElementTree.tostring(collision)


@pytest.mark.parametrize("write", [urdf, mjcf])
def test_the_file_says_which_figures_are_guesses(
    tree: Morphology, write: Callable[[Description], str]
) -> None:
    remarks = re.findall("<!-- (.*?) -->", write(described(tree)))
    (masses,) = (remark for remark in remarks if remark.startswith("Masses"))
    assert f"main body's {tree.base.mass:.4g} kg" in masses
    assert f"{tree.masses.sum():.4g} kg together" in masses
    assert any("Efforts are a guess" in remark for remark in remarks)


def test_a_servo_in_mujoco_turns_as_fast_as_the_robots_and_holds_the_body_up() -> None:
    leg = Part(parent=BASE, mount=1, hinge=2, length=0.2, radius=0.006, motor=0)
    base = Base(size=(0.1, 0.1, 0.1), mass=1.0)
    body = Morphology(base=base, parts=(leg,), density=1000.0)
    model = mujoco.MjModel.from_xml_string(mjcf(described(body)))
    data = mujoco.MjData(model)
    data.ctrl[0], fastest = 1.0, 0.0
    while data.time < 2:
        mujoco.mj_step(model, data)
        fastest = max(fastest, float(data.joint("servo_0").qvel[0]))
    assert fastest == pytest.approx(JOINTS[0].speed, rel=0.05)
    assert data.joint("servo_0").qpos[0] == pytest.approx(1.0, abs=0.01)


def test_names_are_one_word_and_each_its_own(tmp_path: Path) -> None:
    parts = tuple(
        Part(parent=parent, mount=1, hinge=2, length=0.1, radius=0.006, motor=motor)
        for parent, motor in ((BASE, 1), (BASE, 0), (0, None))
    )
    body = Morphology(base=Base(size=(0.1,) * 3, mass=1.0), parts=parts, density=1000.0)
    found = describe(
        body,
        robot="r",
        parts=["a leg", "a_leg", "body"],
        carried=[1, 0, None],
        joints=JOINTS,
    )
    assert [link.name for link in found.links] == ["a_leg_2", "a_leg", "body_2"]
    assert [link.joint.name for link in found.links] == ["servo_0", "servo_1", "body_fixed"]
    assert json.loads(as_json(found))["links"][2]["joint"]["parent"] == "a_leg"
    path = tmp_path / "body.urdf"
    path.write_text(urdf(found), encoding="utf-8")
    assert [motor.name for motor in load_body(path).motors] == ["servo_0", "servo_1"]
