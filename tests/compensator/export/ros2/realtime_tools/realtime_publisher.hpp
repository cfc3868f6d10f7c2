// The least of realtime_tools that an exported controller needs; `sent` is for the test.
#pragma once
#include <memory>
#include "rclcpp/rclcpp.hpp"

namespace realtime_tools
{
template <typename Message>
class RealtimePublisher
{
public:
  explicit RealtimePublisher(std::shared_ptr<rclcpp::Publisher<Message>> publisher) : publisher_(publisher) {}
  bool trylock() { return true; }
  void unlockAndPublish() { publisher_->publish(msg_); }
  Message msg_;

private:
  std::shared_ptr<rclcpp::Publisher<Message>> publisher_;
};
}  // namespace realtime_tools
