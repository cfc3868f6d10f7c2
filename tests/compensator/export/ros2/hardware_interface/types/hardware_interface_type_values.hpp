#pragma once
namespace hardware_interface
{
constexpr char HW_IF_EFFORT[] = "effort";
constexpr char HW_IF_POSITION[] = "position";
}
