#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "tests/integration/daemon_process.h"

namespace mapkeep {

/// A RADOS cluster on loopback, for the life of this.
class RadosCluster {
 public:
  RadosCluster() { EXPECT_EQ(Run("up"), 0); }
  ~RadosCluster() { EXPECT_EQ(Run("down"), 0); }
  RadosCluster(const RadosCluster&) = delete;
  RadosCluster& operator=(const RadosCluster&) = delete;

  /// A command of tests/rados_cluster; gives its exit status.
  int Run(const std::string& command) const {
    return std::system((MAPKEEP_RADOS_CLUSTER " " + command + " " + directory_.path() + "/ceph").c_str());
  }

  /// Flags of a daemon on it, whose leases end after three seconds; `more` stands before all tables.
  std::vector<std::string> Flags(const std::string& more = "") const {
    const std::string file = directory_.path() + "/mapkeepd.toml";
    std::ofstream(file) << more << "\nengine = \"rados\"\n[rados]\nconf = \"" << directory_.path()
                        << "/ceph/ceph.conf\"\npool = \"maps\"\nuser = \"maps\"\nkeyring = \"" << directory_.path()
                        << "/ceph/client.maps.keyring\"\n[limits]\nlease_seconds = 3\n";
    return {"--config", file};
  }

 private:
  TemporaryDirectory directory_;
};

}  // namespace mapkeep
