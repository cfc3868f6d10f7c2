// Takes the controller through its life, and prints its command and status for each reference on standard input; the
// arguments are the period of its updates [s], the interface of the actuator, what its state tells at activation, and the
// names of the joints that move the path, then of the interface of a sensor, whose values follow each reference.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include "controller_interface/chainable_controller_interface.hpp"

controller_interface::ChainableControllerInterface * make_controller();

int main(int count, char ** arguments)
{
  using controller_interface::CallbackReturn;
  double command = 0.0, reference = 0.0, present = NAN;
  auto * const controller = make_controller();
  const rclcpp_lifecycle::State state;
  const std::string own = std::string("finger/") + arguments[2];
  if (controller->on_init() != CallbackReturn::SUCCESS) return 1;
  for (int k = 4; k < count; k++) {
    if (std::string(arguments[k]).find('/') != std::string::npos) controller->get_node()->values["sensor"] = std::string(arguments[k]);
  }
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 2;  // no joint
  controller->get_node()->values["joint"] = std::string("finger");
  controller->update_rate = 20;
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 3;  // every update would be a pause
  controller->update_rate = 500;
  controller->get_node()->values["mu_pull"] = -1.0;
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 4;  // a bad parameter
  controller->get_node()->values["mu_pull"] = 0.2;
  controller->get_node()->values["start"] = std::string("now");
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 12;  // no such start
  controller->get_node()->values["start"] = std::string("measured");
  if (controller->on_configure(state) != CallbackReturn::SUCCESS) return 5;
  if (controller->command_interface_configuration().names != std::vector<std::string>{own}) return 6;
  auto interfaces = controller->exported();
  if (interfaces.size() != 1 || interfaces[0].get_name() != "tension/tension") return 7;
  controller->command_interfaces_.emplace_back("finger", arguments[2], &command);
  std::vector<double> angles(static_cast<std::size_t>(count - 4));
  std::vector<std::string> names;
  for (std::size_t k = 0; k < angles.size(); k++) {
    const std::string name = arguments[k + 4];
    names.push_back(name.find('/') == std::string::npos ? name + "/position" : name);
    controller->state_interfaces_.emplace_back(&angles[k]);
  }
  names.push_back(own);
  controller->state_interfaces_.emplace_back(&present);
  if (controller->state_interface_configuration().names != names) return 10;
  if (controller->on_activate(state) != CallbackReturn::ERROR) return 13;  // the state is no number
  present = std::atof(arguments[3]);
  if (controller->on_activate(state) != CallbackReturn::SUCCESS) return 8;
  while (std::scanf("%lf", &reference) == 1) {
    interfaces[0].set_value(reference);
    for (auto & angle : angles) {
      if (std::scanf("%lf", &angle) != 1) return 11;
    }
    if (controller->update_and_write_commands({}, {std::atof(arguments[1])}) != controller_interface::return_type::OK) return 9;
    std::printf("%.17g %u\n", command, rclcpp::published);
  }
  if (controller->on_deactivate(state) != CallbackReturn::SUCCESS) return 14;
  std::printf("%.17g %u\n", command, rclcpp::published);
  delete controller;
  return 0;
}
