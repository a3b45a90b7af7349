#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/unit/storage/status_matchers.h"
#include "tests/unit/storage/test_engine.h"

namespace mapkeep {

/// What every engine promises: engine_conformance.cc has the tests, each engine's own test file runs them.
class EngineTest : public testing::TestWithParam<EngineKind> {
 protected:
  absl::Status Put(std::string_view partition, const std::string& key, const std::string& value,
                   Durability durability = Durability::kBuffered) {
    const std::vector<Mutation> row = {{key, value}};
    return engine_->Write(partition, row, durability);
  }

  using Rows = std::vector<std::pair<std::string, std::string>>;

  Rows RowsOf(std::string_view partition, std::string_view begin = "", std::string_view end = "") {
    Rows rows;
    EXPECT_DONE(engine_->Scan(partition, begin, end, [&rows](std::string_view key, std::string_view value) {
      rows.emplace_back(key, value);
      return true;
    }));
    return rows;
  }

  std::vector<std::string> ValueKeysOf(std::string_view group, std::string_view begin = "", std::string_view end = "") {
    std::vector<std::string> keys;
    EXPECT_DONE(engine_->ScanValueKeys(group, begin, end, [&keys](std::string_view key) {
      keys.emplace_back(key);
      return true;
    }));
    return keys;
  }

  absl::Status Swap(const std::vector<Condition>& conditions, const std::vector<Mutation>& mutations) {
    return engine_->CompareAndSet("p", conditions, mutations);
  }

  std::optional<std::string> Find(const std::string& key) {
    const auto found = engine_->Get("p", key);
    EXPECT_DONE(found);
    return found.ok() ? *found : std::nullopt;
  }

  TestEngine engine_{GetParam()};
};

}  // namespace mapkeep
