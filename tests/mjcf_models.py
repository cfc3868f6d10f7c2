"""Small models with tendons: cylinders, spheres, sidesites, wraps of more than half a turn, wraps from inside."""

import math

TWO_JOINTS = """
<mujoco model="two joints"><compiler angle="radian"/>
  <worldbody>
    <site name="f0" pos="-.06 0 -.008"/><site name="f1" pos="-.014 0 -.0085"/>
    <site name="m0" pos="-.06 .004 -.008"/><site name="m1" pos="-.014 .004 -.0085"/>
    <site name="e0" pos="-.06 0 .012"/><site name="e1" pos="-.022 0 .014"/><site name="over" pos="0 0 .03"/>
    <geom name="drum" type="cylinder" fromto="0 -.006 0 0 .006 0" size=".013" mass="0" contype="0" conaffinity="0"/>
    <body name="first">
      <joint name="mcp" axis="0 1 0" range="-.2 1.4" damping=".003"/>
      <geom type="capsule" fromto=".01 0 0 .035 0 0" size=".006" mass=".02" contype="0" conaffinity="0"/>
      <site name="f2" pos=".012 0 -.0085"/><site name="f3" pos=".034 0 -.008"/><site name="m2" pos=".014 .004 -.0085"/>
      <site name="e2" pos=".021 0 .0095"/><site name="e3" pos=".034 0 .0085"/><site name="over_pip" pos=".045 0 .02"/>
      <geom name="ball" type="sphere" pos=".045 0 0" size=".0065" mass="0" contype="0" conaffinity="0"/>
      <body name="second" pos=".045 0 0">
        <joint name="pip" axis="0 1 0" range="0 1.6" damping=".002"/>
        <geom type="capsule" fromto=".007 0 0 .03 0 0" size=".005" mass=".012" contype="0" conaffinity="0"/>
        <site name="f4" pos=".011 0 -.007"/><site name="e4" pos=".012 0 .006"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="flexor"><site site="f0"/><site site="f1"/><site site="f2"/><site site="f3"/>
      <site site="f4"/></spatial>
    <spatial name="short"><site site="m0"/><site site="m1"/><site site="m2"/></spatial>
    <spatial name="extensor"><site site="e0"/><site site="e1"/><geom geom="drum" sidesite="over"/><site site="e2"/>
      <site site="e3"/><geom geom="ball" sidesite="over_pip"/><site site="e4"/></spatial>
  </tendon>
  <actuator>
    <position name="flexor_motor" tendon="flexor"/><position name="short_motor" tendon="short"/>
    <position name="extensor_motor" tendon="extensor"/>
  </actuator>
</mujoco>
"""

THREE_JOINTS = """
<mujoco model="three joints"><compiler angle="radian"/>
  <worldbody>
    <site name="s0" pos="-.05 .004 .01"/><site name="s1" pos="-.02 .003 .012"/><site name="top" pos="0 0 .04"/>
    <body name="a"><joint name="side" axis="0 0 1" range="-.4 .4"/><geom size=".005" mass=".01"/>
      <geom name="drum" type="cylinder" fromto="0 -.02 0 0 .02 0" size=".01"/>
      <body name="b"><joint name="bend" axis="0 1 0" range="-.3 1.3"/><geom size=".005" mass=".01"/>
        <site name="s2" pos=".024 -.002 .011"/><site name="top2" pos=".09 0 .02"/>
        <geom name="post" type="cylinder" fromto=".05 -.01 -.002 .05 .01 .002" size=".008"/>
        <body name="c" pos=".05 0 0"><joint name="tip" axis="0 1 .2" range="0 1.2"/><geom size=".005" mass=".01"/>
          <site name="s3" pos=".02 .001 .006"/></body></body></body>
  </worldbody>
  <tendon><spatial name="cord"><site site="s0"/><site site="s1"/><geom geom="drum" sidesite="top"/><site site="s2"/>
    <geom geom="post" sidesite="top2"/><site site="s3"/></spatial></tendon>
</mujoco>
"""

REACH_M, RADIUS_M = 0.012, 0.01

CAPSTAN = f"""
<mujoco model="capstan"><compiler angle="radian"/>
  <worldbody>
    <site name="near" pos="-{REACH_M} 0 0"/><site name="under" pos=".05 0 0"/>
    <geom name="post" type="cylinder" fromto="0 0 -.01 0 0 .01" size="{RADIUS_M}"/>
    <body name="arm"><joint name="turn" axis="0 0 1" range="0 2.4"/><geom size=".002" pos=".03 0 0" mass=".01"/>
      <site name="far" pos="{REACH_M * math.cos(0.5)} {REACH_M * math.sin(0.5)} 0"/></body>
  </worldbody>
  <tendon><spatial name="cord"><site site="near"/><geom geom="post" sidesite="under"/>
    <site site="far"/></spatial></tendon>
</mujoco>
"""
"""A post around which the tendon goes below: it bends by pi + 0.5 + q less the angles of both tangents."""

RING = """
<mujoco model="ring"><compiler angle="radian"/>
  <worldbody>
    <site name="near" pos="-.03 0 0"/><site name="middle" pos="0 0 .002"/>
    <geom name="ring" type="cylinder" fromto="0 -.01 0 0 .01 0" size=".006"/>
    <body name="arm"><joint name="turn" axis="0 1 0" range="-.3 1.2"/><geom size=".002" pos=".03 0 0" mass=".01"/>
      <site name="far" pos=".03 0 .001"/></body>
  </worldbody>
  <tendon><spatial name="cord"><site site="near"/><geom geom="ring" sidesite="middle"/>
    <site site="far"/></spatial></tendon>
</mujoco>
"""

FIXED = """
<mujoco><worldbody><body><joint name="one" axis="0 1 0" range="0 60"/><geom size=".01" mass=".01"/>
  <body pos=".05 0 0"><joint name="two" axis="0 1 0" range="0 60" stiffness=".1"/><geom size=".01" mass=".01"/></body>
  </body></worldbody>
  <tendon><fixed name="pull"><joint joint="one" coef="-.01"/><joint joint="two" coef="-.006"/></fixed>
  <fixed name="back"><joint joint="one" coef=".012"/></fixed></tendon></mujoco>
"""
