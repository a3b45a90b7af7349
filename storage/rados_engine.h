#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <string>

#include "storage/engine.h"

namespace mapkeep {

struct RadosOptions {
  std::string conf;              ///< ceph.conf: monitors and the like; empty: librados looks in the usual places
  std::string pool = "mapkeep";  ///< which must exist
  std::string name_space;        ///< inside the pool, so that several fleets may share one; may be empty
  std::string user = "admin";    ///< of cephx: client.<user>
  std::string keyring;           ///< file with the user's key; empty: as the conf says
  double timeout_seconds = 30;   ///< after which an operation has no known outcome
};

/// The distributed engine: Ceph RADOS through librados. Any number of daemons may have the pool open.
///
/// - A partition is an object, its rows the object's omap. A compare-and-set is one compound operation on it: RADOS
///   compares and writes in one step. It cannot tell an empty value from an absent one, so every row has a byte before
///   its value. Only the rows' keys and values are bounded: a write above 90 MB is refused by the OSDs, and one object
///   should stay below 100,000 rows.
/// - A group's values are packed, in batches of up to 4 MiB, into objects that are written once. The group's index
/// object
///   says where each value lies: an omap row a value, and one a batch with the number of values that are left in it;
///   the batch goes with its last value. The data is written before the index, so that what the index names is there.
/// - What RADOS acknowledges is on the disks of the acting set: every write is durable.
/// - No answer in time is DEADLINE_EXCEEDED: the operation may have been applied, or may still be.
/// - There is no checkpoint (UNIMPLEMENTED): see CopyMap for one map as of one epoch.
///
/// UNAVAILABLE if the cluster does not answer, PERMISSION_DENIED for a bad key, NOT_FOUND without the pool.
absl::StatusOr<std::unique_ptr<Engine>> OpenRadosEngine(const RadosOptions& options);

}  // namespace mapkeep
