#pragma once

namespace mapkeep {

/// For the steps of long work that gives way: if the calling thread has gone on for half a millisecond since it last
/// did, whoever else waits for its processor runs first. The kernel by itself looks at its tick only, every four
/// milliseconds at the usual 250 Hz, if whoever woke has had his share.
void LetOthersRun();

}  // namespace mapkeep
