// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "pagesweep/timing/bell_batch_internal.h"
#include "pagesweep/timing/bell_tables_internal.h"
#include "pagesweep/timing/sensor_noise.h"

namespace pagesweep {

/// Fits bells to the samples of some pixels at once: the estimate of fit_bell() for the plain case, in which all
/// samples around the bell were recorded and none is clipped. That is nearly every pixel, so it is what speed depends
/// on.
///
/// Two or three least squares steps with even weights, which with a known profile are dot products with tabulated
/// weights, bring the bell within a small part of the stripe's width; then Gauss-Newton steps weight every sample with
/// the noise that the model lets expect there. Sums run along time; the equations of all pixels are solved side by
/// side. One a thread.
class PlainBells {
 public:
  struct Fit {
    bool converged = false;  ///< if not, the pixel is not a plain case, and nothing else here holds but
    double time = 0;         ///< [frames] where the bell was last seen, far from where it was expected
    double amplitude = 0;    ///< [gray values]
    double background = 0;   ///< [gray values]
    double time_sigma = 0;   ///< [frames] from the noise alone
    double chi_square = 0;   ///< of all samples
    int samples = 0;
  };

  /// \param tables  must outlive this
  /// \param fwhm    of the stripe [frames]
  PlainBells(const BellTables& tables, const SensorNoise& noise, double fwhm);

  /// How many samples before and after the expected middle frame every pixel must have.
  int reach() const { return batch_.middle; }
  /// How many of them are looked at where the stripe is that wide.
  int reach(double log_width) const { return tables_.at(log_width).reach + margin_; }

  void clear() { batch_.count = 0; }
  /// Another pixel. The arrays must last until fit() and reach `most_bells` entries beyond the samples.
  /// \param gray     samples of frames centre - reach() ... centre + reach(); any number where there is none
  /// \param present  for each of them 1 if it is there, else 0
  /// \param late     for each of them [frames] by which it was exposed later; null for all pixels: not at all
  void add(int centre, double log_width, const float* gray, const float* present, const float* late = nullptr);
  /// [frames] Samples that were exposed more than this before or after their frame are none of a plain case.
  double most_late() const { return most_late_; }
  /// Bells whose samples are all there.
  void fit();
  /// Bells of which some samples are missing.
  void fit_partial();
  Fit operator[](int i) const;

 private:
  const BellTables& tables_;
  int margin_;  ///< [frames] the expected middle may be off
  double most_late_;
  BellBatch batch_;
  BellBatch::Each<int> centre_{};
};

}  // namespace pagesweep
