#pragma once
#define PLUGINLIB_EXPORT_CLASS(derived, base) \
  base * make_controller() { return new derived(); }
