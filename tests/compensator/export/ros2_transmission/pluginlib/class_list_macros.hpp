#pragma once
#define PLUGINLIB_EXPORT_CLASS(derived, base) \
  base * make_loader() { return new derived(); }
