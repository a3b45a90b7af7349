#include "server/http/request_target.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapkeep {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

TEST(RequestTarget, IsDecodedSegmentBySegment) {
  const auto target = ParseRequestTarget("/v1/maps/y%61rd%3A1/voxel?x=-1.5&y=2e3&z=0&note=a+b%26c&x=9&flag");
  ASSERT_TRUE(target.ok());
  EXPECT_THAT(target->path, ElementsAre("v1", "maps", "yard:1", "voxel"));
  EXPECT_EQ(*target->QueryCoordinate("x"), -1.5);
  EXPECT_EQ(*target->QueryCoordinate("y"), 2000);
  EXPECT_EQ(target->Query("note"), "a b&c");
  EXPECT_EQ(target->Query("flag"), "");
  EXPECT_EQ(target->Query("absent"), "");
}

TEST(RequestTarget, TheRootHasNoSegmentsAndAnEndingSlashAddsNone) {
  EXPECT_THAT(ParseRequestTarget("/")->path, IsEmpty());
  EXPECT_THAT(ParseRequestTarget("/?a=b")->path, IsEmpty());
  EXPECT_THAT(ParseRequestTarget("/viewer/")->path, ElementsAre("viewer"));
}

TEST(RequestTarget, WhatCouldLeadElsewhereIsRefused) {
  for (const char* target :
       {"",       "viewer",  "http://x/",  "*",      "//",    "/a//b", "/.",  "/..",  "/a/../b", "/%2e%2e/x",
        "/a/%2E", "/a%2fb",  "/a%2F..%2f", "/a%5cb", "/a\\b", "/%",    "/%4", "/%zz", "/a%00b",  "/a%0d%0aSet-Cookie:x",
        "/?a=%",  "/?%00=1", "/a\x01",     "/a\x7f"}) {
    EXPECT_EQ(ParseRequestTarget(target).status().code(), absl::StatusCode::kInvalidArgument) << target;
  }
  EXPECT_FALSE(ParseRequestTarget("/" + std::string(kLargestTarget, 'a')).ok());
}

TEST(RequestTarget, NumbersAreNumbers) {
  const auto target = ParseRequestTarget("/?a=12&b=-1&c=01&d=1e3&e=18446744073709551616&f=&g=nan&h=inf&i=1x");
  ASSERT_TRUE(target.ok());
  EXPECT_EQ(**target->QueryNumber("a"), 12U);
  EXPECT_FALSE(target->QueryNumber("absent")->has_value());
  for (const char* name : {"b", "c", "d", "e", "f"}) EXPECT_FALSE(target->QueryNumber(name).ok()) << name;
  for (const char* name : {"f", "g", "h", "i", "absent"}) EXPECT_FALSE(target->QueryCoordinate(name).ok()) << name;
}

}  // namespace
}  // namespace mapkeep
