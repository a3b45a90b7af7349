#pragma once

namespace mapkeep {

/// From here on the calling thread gives way to threads that somebody waits for: whoever asks for a tile is answered at
/// once while scans are staged and sessions merged, which take what is left. Cannot be taken back.
void GiveWay();

/// From here on the calling thread moves bytes for others: likewise as AnswerSoon, which comes before it.
void MoveBytes();

/// From here on the calling thread, and those that it starts and that do not give way, get a processor soon after they
/// wake, also from another thread in the middle of its time: for short work that somebody waits for. Takes no larger
/// share of the processor. On a kernel before Linux 6.12 nothing changes.
void AnswerSoon();

}  // namespace mapkeep
