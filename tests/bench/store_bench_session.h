#pragma once

#include <string>

namespace mapkeep {

/// Takes the two halves of a drive in the KITTI layout, as two sessions, from acknowledged scans to committed epochs
/// through every stage of the pipeline on a RocksDB in `directory`, and prints milliseconds a scan with the stages'
/// shares, then what the map takes on disk and where the bytes go.
void RunWholeSessions(const std::string& directory, const std::string& drive);

}  // namespace mapkeep
