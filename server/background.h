#pragma once

namespace mapkeep {

/// From here on the calling thread gives way to threads that somebody waits for: whoever asks for a tile is answered at
/// once while scans are staged and sessions merged, which take what is left. Cannot be taken back.
void GiveWay();

}  // namespace mapkeep
