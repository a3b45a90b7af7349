#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>

namespace mapkeep {

/// How a call ended.
struct AnyAnswer {
  grpc::Status status;
  std::map<std::string, std::string> trailers;
  int messages = 0;  ///< that were answered
};

/// Any method by its path ("/mapkeep.v1.MapService/GetMap"), unary or stream: sends one message of raw bytes and the
/// end, takes every answer. `token`: none if empty. `request_id`: likewise.
AnyAnswer CallAny(const std::shared_ptr<grpc::Channel>& channel, const std::string& path, const std::string& bytes,
                  const std::string& token = "", const std::string& request_id = "",
                  std::chrono::seconds deadline = std::chrono::seconds(30));

/// A channel of its own: no connection is shared with another one.
std::shared_ptr<grpc::Channel> ChannelTo(
    const std::string& address,
    const std::shared_ptr<grpc::ChannelCredentials>& credentials = grpc::InsecureChannelCredentials());

}  // namespace mapkeep
