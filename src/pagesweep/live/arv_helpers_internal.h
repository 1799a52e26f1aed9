// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <arv.h>

#include <memory>
#include <string>

namespace pagesweep {

struct Unreference {
  void operator()(void* object) const { g_object_unref(object); }
};
/// One reference to an object of Aravis.
template <class T>
using ArvHandle = std::unique_ptr<T, Unreference>;

inline std::string text_or_nothing(const char* text) { return text ? text : ""; }

}  // namespace pagesweep
