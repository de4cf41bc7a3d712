"""Tests of one loop as a project of its own would write them.

On the shipped fake:      pytest
On a real bench:          pytest --ah-profile bench.toml --ah-target modbus+tcp://192.0.2.10:502 --ah-arm
"""

import pytest


@pytest.mark.ah_loop("DPIDE")
@pytest.mark.ah_plant(kind="fopdt", gain=1.2, tau_s=2.0, dead_time_s=0.2, bias=10.0, noise=0.02, initial=50.0)
def test_a_step_of_sv_is_followed(ah_loop):
    ah_loop.start(SV=50.0, CYCLE=100, Kc_Kp=1.2, Ti_Ki=0.5)
    ah_loop.at(4.0, SV=58.0)
    ran = ah_loop.run(9.0, clamps=True)

    assert ran.agrees
    assert not ran.violated
    assert abs(ran.at(9.0)["PV"] - 58.0) < 3.0


@pytest.mark.ah_loop("DPID")
@pytest.mark.ah_plant(kind="integrating", gain=0.1, bias=-1.0, noise=0.01, initial=45.0)
def test_a_level_is_held_against_a_draw(ah_loop, ah_station):
    assert ah_station.bench
    ah_loop.start(SV=45.0, CYCLE=10, Kp=6.0, Ki=1.0)
    ah_loop.load(4.0, -5.0)
    ran = ah_loop.run(14.0)

    assert ran.agrees
    assert abs(ran.at(14.0)["PV"] - 45.0) < 3.0
