// The least of rclcpp and rclcpp_lifecycle that an exported controller needs, to compile and run it without ROS.
#pragma once
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#define RCLCPP_ERROR(logger, ...) (static_cast<void>(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))

namespace rclcpp
{
struct Time {};
struct Duration
{
  double length = 0.0;
  double seconds() const { return length; }
};
struct Logger {};
struct SystemDefaultsQoS {};
inline unsigned published = 0;  // what the test looks at
template <typename Message>
struct Publisher
{
  void publish(const Message & message) { published = message.data; }
};
using Value = std::variant<std::string, double, std::vector<std::string>>;
struct Parameter
{
  Value value;
  std::string as_string() const { return std::get<std::string>(value); }
  std::vector<std::string> as_string_array() const { return std::get<std::vector<std::string>>(value); }
  double as_double() const { return std::get<double>(value); }
};
}  // namespace rclcpp

namespace rclcpp_lifecycle
{
struct State {};
struct LifecycleNode
{
  std::map<std::string, rclcpp::Value> values;
  rclcpp::Parameter get_parameter(const std::string & name) const { return {values.at(name)}; }
  rclcpp::Logger get_logger() const { return {}; }
  const char * get_name() const { return "tension"; }
  template <typename Message>
  std::shared_ptr<rclcpp::Publisher<Message>> create_publisher(const std::string &, rclcpp::SystemDefaultsQoS)
  {
    return std::make_shared<rclcpp::Publisher<Message>>();
  }
};
}  // namespace rclcpp_lifecycle
