// Takes the controller through its life, and prints its command for each reference on standard input; the argument is the
// period of its updates [s].
#include <cstdio>
#include <cstdlib>
#include "controller_interface/chainable_controller_interface.hpp"

controller_interface::ChainableControllerInterface * make_controller();

int main(int, char ** arguments)
{
  using controller_interface::CallbackReturn;
  double command = 0.0, reference = 0.0;
  auto * const controller = make_controller();
  const rclcpp_lifecycle::State state;
  if (controller->on_init() != CallbackReturn::SUCCESS) return 1;
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 2;  // no joint
  controller->get_node()->values["joint"] = std::string("finger");
  controller->update_rate = 20;
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 3;  // every update would be a pause
  controller->update_rate = 500;
  controller->get_node()->values["mu_pull"] = -1.0;
  if (controller->on_configure(state) != CallbackReturn::ERROR) return 4;  // a bad parameter
  controller->get_node()->values["mu_pull"] = 0.2;
  if (controller->on_configure(state) != CallbackReturn::SUCCESS) return 5;
  if (controller->command_interface_configuration().names != std::vector<std::string>{"finger/effort"}) return 6;
  auto interfaces = controller->exported();
  if (interfaces.size() != 1 || interfaces[0].get_name() != "tension/tension") return 7;
  controller->command_interfaces_.emplace_back("finger", "effort", &command);
  if (controller->on_activate(state) != CallbackReturn::SUCCESS) return 8;
  while (std::scanf("%lf", &reference) == 1) {
    interfaces[0].set_value(reference);
    if (controller->update_and_write_commands({}, {std::atof(arguments[1])}) != controller_interface::return_type::OK) return 9;
    std::printf("%.17g\n", command);
  }
  delete controller;
  return 0;
}
