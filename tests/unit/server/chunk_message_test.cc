#include "server/rpc/chunk_message.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "mapkeep/v1/session_service.pb.h"

namespace mapkeep {
namespace {

std::string Message(const std::string& chunk) {
  v1::UploadScansRequest request;
  request.set_chunk(chunk);
  return request.SerializeAsString();
}

std::vector<std::string_view> Slices(std::string_view message, size_t each) {
  std::vector<std::string_view> slices;
  for (size_t at = 0; at < message.size(); at += each) slices.push_back(message.substr(at, each));
  return slices;
}

std::string Joined(const std::vector<std::string_view>& pieces) {
  std::string all;
  for (const std::string_view piece : pieces) all += piece;
  return all;
}

TEST(ChunkMessage, IsFoundHoweverItIsCut) {
  for (const size_t size : {0, 1, 127, 128, 20'000}) {
    std::string chunk(size, 'x');
    for (size_t i = 0; i < size; ++i) chunk[i] = static_cast<char>(i * 7);
    const std::string message = Message(chunk);
    for (const size_t each : {size_t{1}, size_t{2}, size_t{3}, size_t{100}, message.size()}) {
      const auto found = ChunkIn(Slices(message, each));
      ASSERT_TRUE(found) << size << " in slices of " << each;
      EXPECT_EQ(Joined(*found), chunk);
    }
  }
}

TEST(ChunkMessage, WhatIsAnythingElseIsLeftToTheParser) {
  const auto found = [](const std::string& message) { return ChunkIn(Slices(message, 5)).has_value(); };
  const std::string message = Message("a chunk");
  for (size_t length = 0; length < message.size(); ++length) EXPECT_FALSE(found(message.substr(0, length))) << length;
  EXPECT_FALSE(found(message + "\x10")) << "something follows";
  EXPECT_FALSE(found(message + message)) << "the last of two counts";
  v1::UploadScansRequest header;
  header.mutable_scan()->set_point_count(3);
  EXPECT_FALSE(found(header.SerializeAsString()));
  EXPECT_FALSE(found("\x1a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01x")) << "a length beyond all bounds";
}

}  // namespace
}  // namespace mapkeep
