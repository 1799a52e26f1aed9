// SPDX-License-Identifier: Apache-2.0
#include <arv.h>

#include "pagesweep/live/arv_helpers_internal.h"
#include "pagesweep/live/genicam_camera.h"
#include "pagesweep/live/gige_probe_internal.h"

namespace pagesweep {
namespace {

/// What only the camera itself can tell.
void ask(FoundCamera& found) {
  if (probe_gige(found.address) == GigeAnswer::none) {  // it was heard, but cannot be spoken to
    found.problem = why_silent(found.address);
    return;
  }
  GError* failure = nullptr;
  const ArvHandle<ArvCamera> camera(arv_camera_new(found.id.c_str(), &failure));
  if (camera) arv_camera_get_sensor_size(camera.get(), &found.sensor_width, &found.sensor_height, &failure);
  if (camera && !failure) {
    guint count = 0;
    const char** formats = arv_camera_dup_available_pixel_formats_as_strings(camera.get(), &count, &failure);
    for (guint i = 0; formats && i < count; ++i) found.pixel_formats.emplace_back(formats[i]);
    g_free(formats);
  }
  if (failure) found.problem = failure->message;
  g_clear_error(&failure);
  if (!camera) return;
  ArvDevice* device = arv_camera_get_device(camera.get());
  if (found.problem.empty() && ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device)))
    found.problem = "another program has it";
}

}  // namespace

std::vector<FoundCamera> find_cameras() {
  arv_update_device_list();
  std::vector<FoundCamera> cameras;
  for (guint i = 0; i < arv_get_n_devices(); ++i) {
    FoundCamera found;
    found.id = text_or_nothing(arv_get_device_id(i));
    found.vendor = text_or_nothing(arv_get_device_vendor(i));
    found.model = text_or_nothing(arv_get_device_model(i));
    found.serial = text_or_nothing(arv_get_device_serial_nbr(i));
    found.address = text_or_nothing(arv_get_device_address(i));
    found.protocol = text_or_nothing(arv_get_device_protocol(i));
    cameras.push_back(std::move(found));
  }
  for (FoundCamera& camera : cameras) ask(camera);
  return cameras;
}

std::string why_missing(const std::string& id) { return why_silent(id); }

}  // namespace pagesweep
