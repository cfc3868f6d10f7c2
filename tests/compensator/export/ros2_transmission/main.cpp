// Commands of a joint on standard input; prints the actuator's command, and where the joint then stands by the motor.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include "transmission_interface/transmission_loader.hpp"
#include "tff_transmission.hpp"

transmission_interface::TransmissionLoader * make_loader();

int main(int, char ** arguments)
{
  double wanted = 0.0, motor = 0.0, seen = 0.0, motor_seen = 0.0;
  auto * const loader = make_loader();
  if (loader->load({"t", {{"nobody"}}, {{"motor"}}}) != nullptr) return 1;
  if (loader->load({"t", {{arguments[1]}}, {{"motor", 0.0}}}) != nullptr) return 2;
  const auto made = loader->load({"t", {{arguments[1], 2.0, 0.25}}, {{"motor", -30.0, 1.0}}});
  if (made == nullptr) return 2;
  auto & command = dynamic_cast<tff_transmission::JointTransmission &>(*made);
  tff_transmission::JointTransmission state(arguments[1], 1.0, -30.0, 0.25, 2.0);
  if (command.num_joints() != 1 || command.num_actuators() != 1) return 3;
  try {
    command.configure({{arguments[1], "velocity", &wanted}}, {{"motor", "position", &motor}});
    return 4;
  } catch (const transmission_interface::Exception &) {
  }
  command.configure({{arguments[1], "position", &wanted}}, {{"motor", "position", &motor}});
  state.configure({{arguments[1], "position", &seen}}, {{"motor", "position", &motor_seen}});
  command.set_period(2e-3);
  state.set_period(2e-3);
  while (std::scanf("%lf", &wanted) == 1) {
    command.joint_to_actuator();
    motor_seen = motor;
    state.actuator_to_joint();
    if (command.status() != 0u || state.status() != 0u) return 5;
    std::printf("%.17g %.17g\n", motor, seen);
  }
  motor_seen = NAN;
  const double last = seen;
  for (int k = 0; k < 3; k++) {
    state.actuator_to_joint();
  }
  wanted = NAN;
  const double held = motor;
  command.joint_to_actuator();
  if (seen != last || motor != held || state.status() == 0u || command.status() == 0u) return 6;
  delete loader;
  return 0;
}
