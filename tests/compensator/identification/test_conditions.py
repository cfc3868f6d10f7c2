"""Conditions of measured files of one tendon."""

import re

import numpy as np
import pandas as pd
import pytest

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError


@pytest.fixture
def logs(tmp_path):
    """Two files of a tendon that slides to and fro, without angles of joints."""
    time = np.arange(0.0, 4.0, 0.002)
    pulled = 40 + 20 * np.sin(2 * np.pi * 0.5 * time)
    for name in ("straight", "bent"):
        columns = {"time_s": time, "input_tension_N": pulled, "output_tension_N": 0.7 * pulled}
        pd.DataFrame(columns).to_csv(tmp_path / f"{name}.csv", index=False)
    return [tmp_path / "straight.csv", tmp_path / "bent.csv"]


def test_a_condition_stands_for_a_column_of_the_joint(logs):
    joints, given = ("knuckle", "middle"), ("knuckle=0.3", "bent.csv:knuckle=0.9", "middle=-0.1")
    for file, angle in zip(logs, (0.3, 0.9), strict=True):
        motion = read_measurement(file, Measurement(conditions=given), joints).motion
        assert motion.names == joints
        assert (motion.angle_rad == [angle, -0.1]).all()
    with pytest.raises(InputError, match="where it is at rest give --condition"):
        read_measurement(logs[0], Measurement(conditions=given[:2]), joints)


def test_one_capstan_law_is_refused_for_files_of_several_bends(logs, examples):
    scenario, bends = (
        load_scenario(examples / "finger_moving.toml"),
        ("bent.csv:knuckle=0.9", "knuckle=0.3", "middle=0.1"),
    )
    with pytest.raises(
        InputError, match=r"knuckle stands 0\.6 rad apart in these files, the capstan law has one mu theta"
    ):
        identify(scenario, logs, how=Measurement(conditions=bends), static_only=True)


@pytest.mark.parametrize("text", ["bent.csv:knuckle", "bent.csv:=0.3", "knuckle=much", "knuckle=inf"])
def test_a_condition_without_a_joint_or_an_angle_is_refused(text):
    with pytest.raises(ParameterError, match=re.escape(f'conditions must be FILE:JOINT=RAD, got "{text}"')):
        Measurement(conditions=(text,))
