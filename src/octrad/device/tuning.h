// What the device code can be tuned by on a machine without a compiler: one struct, which a Stream carries. Its
// keys: device/tuning_keys.h. No result depends on any of it, but for the order of sums, with `lhs_rounds` on
// GPUs which products and sums are fused, and with `half_moments` how the optimiser rounds.
#pragma once

namespace octrad {

struct DeviceTuning {
  // Casting rays (transport/cast.h).
  int cast_warps = 4096;  // at least so many take part, if there are rays for them; about what large GPUs hold at once
  int cast_share = 16;    // rays for each of a warp's lanes, at most, before there are more warps
  int cast_refill = 8;    // lanes that are done before new rays are taken
  bool cast_dynamic = true;  // warps take rays from what is left of all, else each has its share
  int block = 0;             // threads of a block of element-wise kernels, at most what they are compiled for; 0: that
  // Left-hand-side points (transport/lhs_device.h, train/engine_device.cc).
  int lhs_rounds = -1;        // rays traced for all points together; -1: chosen by the configuration
  int points_ahead = 262144;  // drawn at a time, for several steps
  bool draw_ahead = true;     // by another stream, while steps take those drawn before
  // Sizes of batches.
  int query_chunk = 2097152;    // queries of a training step in flight
  int train_chunk = 65536;      // points whose activations are kept at a time
  int frame_samples = 2097152;  // of a picture's job
  // Alternatives, each of which but `half_moments` gives the same results as the other.
  bool pixel_tiles = true;    // neighbours in a picture are neighbours in memory: tiles of 8 x 4, else rows
  bool direct_film = true;    // a frame of one sample a pixel goes to the screen without sums in double
  bool half_moments = false;  // dense Adam keeps the moments of tables in half the bytes
  bool scan_touched = true;   // the list of touched table entries from a scan over their bits, else as they come
};

}  // namespace octrad
