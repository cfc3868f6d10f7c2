#pragma once
#include <string>
#include <vector>

namespace hardware_interface
{
struct JointInfo { std::string name; };
struct TransmissionInfo { std::string name; std::vector<JointInfo> joints; };
}  // namespace hardware_interface
