#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace transmission_interface
{
class Handle
{
public:
  Handle(const std::string & prefix, const std::string & interface, double * value)
  : prefix_(prefix), interface_(interface), value_(value) {}
  virtual ~Handle() = default;
  operator bool() const { return value_ != nullptr; }
  const std::string & get_interface_name() const { return interface_; }
  const std::string & get_prefix_name() const { return prefix_; }
  double get_value() const { return *value_; }
  bool set_value(double value) { *value_ = value; return true; }

protected:
  std::string prefix_;
  std::string interface_;
  double * value_;
};
class ActuatorHandle : public Handle { public: using Handle::Handle; };
class JointHandle : public Handle { public: using Handle::Handle; };

class Transmission
{
public:
  virtual ~Transmission() = default;
  virtual void configure(
    const std::vector<JointHandle> & joint_handles, const std::vector<ActuatorHandle> & actuator_handles) = 0;
  virtual void actuator_to_joint() = 0;
  virtual void joint_to_actuator() = 0;
  virtual std::size_t num_actuators() const = 0;
  virtual std::size_t num_joints() const = 0;
};
}  // namespace transmission_interface
