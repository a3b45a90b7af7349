#include "storage/map_purge.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "storage/map_rows.h"
#include "storage/map_values.h"
#include "storage/sealed_history.h"

namespace mapkeep {
namespace {

constexpr int kTries = 1024;  ///< each lost race is somebody else's last commit
constexpr size_t kRowsAtOnce = 1000;
constexpr size_t kSmallCache = size_t{1} << 20;
constexpr std::string_view kDeletedHead = "deleted-head";

/// Moves the head aside. What is there to remove is reached from it, or named by the superseded and staged rows.
absl::Status Behead(Engine& engine, const std::string& partition) {
  absl::Status status;
  for (int i = 0; i < kTries; ++i) {
    const absl::StatusOr<std::optional<std::string>> head = engine.Get(partition, kHeadRow);
    if (!head.ok()) return head.status();
    if (!*head) return absl::OkStatus();
    const std::vector<Condition> conditions = {{std::string(kHeadRow), *head}};
    const std::vector<Mutation> mutations = {{std::string(kMapRow), std::nullopt},
                                             {std::string(kHeadRow), std::nullopt},
                                             {std::string(kDeletedHead), *head}};
    status = engine.CompareAndSet(partition, conditions, mutations);
    if (status.ok() || !absl::IsAborted(status)) return status;
  }
  return status;
}

/// The keys and values of the rows that begin with `prefix`.
absl::StatusOr<std::vector<std::pair<std::string, std::string>>> RowsOf(const Engine& engine,
                                                                        const std::string& partition,
                                                                        std::string_view prefix) {
  std::vector<std::pair<std::string, std::string>> rows;
  const absl::Status scanned =
      engine.Scan(partition, prefix, EndOf(prefix), [&rows](std::string_view key, std::string_view value) {
        rows.emplace_back(key, value);
        return true;
      });
  if (!scanned.ok()) return scanned;
  return rows;
}

/// Deletes a node and what it reaches, children first, so that what is left can always be found again.
absl::Status DropTree(Engine& engine, const MapValues& values, const ValueName& name) {
  const absl::StatusOr<std::shared_ptr<const TreeNode>> node = values.ReadNode(name);
  if (node.ok()) {
    std::vector<ValueName> blocks;
    for (const TreeChild& child : (*node)->children) {
      const ValueName below = NameOfChild((*node)->level, (*node)->prefix, child);
      if (below.kind == ValueKind::kBlock) {
        blocks.push_back(below);
      } else if (absl::Status status = DropTree(engine, values, below); !status.ok()) {
        return status;
      }
    }
    if (absl::Status status = DeleteNamed(engine, values.incarnation(), blocks); !status.ok()) return status;
  } else if (!absl::IsDataLoss(node.status())) {
    return node.status();
  }
  return DeleteNamed(engine, values.incarnation(), std::vector{name});
}

absl::Status DropSuperseded(Engine& engine, uint64_t incarnation, const std::string& partition) {
  const auto rows = RowsOf(engine, partition, "superseded/");
  if (!rows.ok()) return rows.status();
  for (const auto& [key, row] : *rows) {
    const absl::StatusOr<Superseded> superseded = DecodeSuperseded(row);
    if (!superseded.ok()) return superseded.status();
    if (absl::Status status = DeleteNamed(engine, incarnation, superseded->names); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status DropStaged(Engine& engine, uint64_t incarnation, const std::string& partition) {
  const auto rows = RowsOf(engine, partition, "staged/");
  if (!rows.ok()) return rows.status();
  for (const auto& [key, row] : *rows) {
    const absl::StatusOr<Staged> staged = DecodeStaged(row);
    if (!staged.ok()) return staged.status();
    if (absl::Status status = DeleteNamed(engine, incarnation, staged->values); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status DropSegments(Engine& engine, uint64_t incarnation) {
  const std::string group = HistoryGroup(incarnation);
  std::vector<std::string> keys;
  const absl::Status scanned = engine.ScanValueKeys(group, "", "", [&keys](std::string_view key) {
    keys.emplace_back(key);
    return true;
  });
  return scanned.ok() ? engine.DeleteValues(group, keys) : scanned;
}

absl::StatusOr<bool> HasLiveIntent(const Engine& engine, const std::string& partition, double now) {
  const auto rows = RowsOf(engine, partition, "intent/");
  if (!rows.ok()) return rows.status();
  for (const auto& [key, row] : *rows) {
    const absl::StatusOr<Intent> intent = DecodeIntent(row);
    if (!intent.ok()) return intent.status();
    if (intent->expires > now) return true;
  }
  return false;
}

absl::Status DropRows(Engine& engine, const std::string& partition) {
  while (true) {
    std::vector<Mutation> mutations;
    absl::Status scanned = engine.Scan(partition, "", "", [&mutations](std::string_view key, std::string_view) {
      mutations.push_back({std::string(key), std::nullopt});
      return mutations.size() < kRowsAtOnce;
    });
    if (!scanned.ok()) return scanned;
    if (mutations.empty()) return absl::OkStatus();
    if (absl::Status status = engine.Write(partition, mutations, Durability::kBuffered); !status.ok()) return status;
  }
}

}  // namespace

absl::StatusOr<bool> PurgeMap(Engine& engine, uint64_t incarnation, double now) {
  const std::string partition = HeadPartition(incarnation);
  if (absl::Status status = Behead(engine, partition); !status.ok()) return status;
  absl::StatusOr<bool> busy = HasLiveIntent(engine, partition, now);
  if (!busy.ok()) return busy;
  if (absl::Status status = DropStaged(engine, incarnation, partition); !status.ok()) return status;
  if (absl::Status status = DropSuperseded(engine, incarnation, partition); !status.ok()) return status;
  const auto head = ReadRow(engine, partition, kDeletedHead, DecodeEpoch);
  if (!head.ok()) return head.status();
  if (*head && (*head)->value.root) {
    MapCaches caches(kSmallCache);
    const MapValues values(engine, caches, incarnation);
    const absl::Status dropped = DropTree(engine, values, NameOfRoot(*(*head)->value.root));
    if (!dropped.ok()) return dropped;
  }
  if (*busy) return false;
  if (absl::Status status = DropSegments(engine, incarnation); !status.ok()) return status;
  if (absl::Status status = DropRows(engine, partition); !status.ok()) return status;
  return true;
}

}  // namespace mapkeep
