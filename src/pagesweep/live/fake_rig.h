// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pagesweep/data/frames.h"
#include "pagesweep/data/picture.h"
#include "pagesweep/live/devices.h"

namespace pagesweep {

/// What a fake rig does, and what goes wrong with it.
struct FakeRigOptions {
  double frame_rate = 100;
  double delay_s = 0.5;
  double packet_loss = 0;
  std::string stall_camera;
  int stall_frame = 0;
  double stall_s = 0.5;
  std::string dead_camera;
  int dead_frame = 0;
  double back_s = 0;
  std::string slow_camera;
  int slow_frame = 0;
  int line_rows = 128;
  int repeat = 1;

  template <class Visitor>
  void describe(Visitor&& visit) {
    visit("frame-rate", frame_rate, "Hz", "of the trigger line that is wired to all cameras");
    visit("delay", delay_s, "s", "from when all cameras wait for triggers to when the stripe comes");
    visit("packet-loss", packet_loss, "", "share of the network packets that get lost, at random");
    visit("stall", stall_camera, "", "a camera that holds its frames back for a while");
    visit("stall-frame", stall_frame, "", "of the capture, at which that begins");
    visit("stall-time", stall_s, "s", "how long that lasts");
    visit("dead", dead_camera, "", "a camera that dies suddenly");
    visit("dead-frame", dead_frame, "", "of the capture, at which that happens");
    visit("back", back_s, "s", "after which it is there again; 0: never");
    visit("slow", slow_camera, "",
          "a camera that slows down, as one that is too hot: it sees every second trigger only");
    visit("slow-frame", slow_frame, "", "of the capture, at which that begins");
    visit("line-rows", line_rows, "", "rows that the line camera sends at a time");
    visit("repeat", repeat, "", "how often the frames are shown in one sweep: for endurance tests");
  }
};

/// What one camera of the rig has sent.
struct FakeCameraCounts {
  std::string name, address, serial;
  long sent = 0;
};

/// Recorded frames as GigE Vision cameras on addresses of this computer: 127.0.0.1 and following, one a camera, the
/// scanner's line camera last. Frames are dark until all cameras wait for triggers; then one sweep begins, and another
/// one whenever they have stopped and wait again. They are sent as often as the trigger line ("Line0") of the rig, the
/// client's software triggers, or the client's frame rate say.
class FakeRig {
 public:
  /// \param frames  of one or more cameras, 8 bit
  /// \param scan    the scanner's picture, if there shall be a line camera
  /// \throws Error  if an address is not this computer's, or is taken
  FakeRig(std::vector<Frames> frames, std::optional<Picture> scan, const FakeRigOptions& options = {});
  ~FakeRig();
  FakeRig(const FakeRig&) = delete;
  FakeRig& operator=(const FakeRig&) = delete;

  std::vector<FakeCameraCounts> counts() const;
  /// How many sweeps have begun.
  int sweeps() const;
  /// Settings that suit it.
  Devices devices() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace pagesweep
