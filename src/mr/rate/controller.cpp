#include "mr/rate/controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mr/core/assert.h"
#include "mr/rate/swept_surface.h"

namespace mr::rate {
namespace {

constexpr int kDecideEvery = 6;    // captures
constexpr int kFewest = 5;         // captures behind a mean that a decision uses
constexpr int kFewestAtWorst = 2;  // the same, while captures are left out
constexpr double kReserve = 0.7;   // of an estimate
constexpr int kStart = 30;         // captures in which what is known changes quickly
constexpr double kMeanOver = 12;   // captures
constexpr int kFinestQp = 18, kCoarsestQp = 51;
constexpr Setting kFinestSetting{kErrorNodes_voxels[0], kBits, 1, kFinestQp};
constexpr int kFirstQp = 42;     // of the first captures, while nothing is known of what they take
constexpr int kFinerAtOnce = 6;  // quantisers, from one capture to the next
constexpr double kUsualKey = 8;  // key frames, in other frames, until one was seen
constexpr double kErrorPower = 0.3;  // bytes of the mesh fall with this power of the error limit
constexpr double kFinerMesh = 1.4;   // errors, by a step
constexpr double kHelps = 0.95;      // an urgent change cuts what is needed to less
constexpr double kOtherNeed = 0.6;   // of what the setting needed first: the scene has changed
constexpr double kLeast_mbps = 0.01;
constexpr double kRepay = 4;                         // captures over which credit is used
constexpr double kMostCredit = 3;                    // captures' worth, saved
constexpr double kPurseAbove = 0.05;                 // seconds' worth, above the backlog's share
constexpr double kHold_s = 1, kHoldReversal_s = 10;  // between changes that are not urgent
constexpr double kLongestGap_s = 1;                  // between captures that are sent

int direction_of(const Setting& from, const Setting& to) {
  const double finer = std::log(from.error_voxels / to.error_voxels) +
                       2 * std::log(to.scale / from.scale) + kPerQp * (from.qp - to.qp);
  return finer > 0 ? 1 : -1;
}

}  // namespace

Controller::Controller(std::shared_ptr<const Model> model, bool layers, double fps,
                       double target_mbps)
    : model_(std::move(model)), nominal_fps_(fps), fps_(fps), setting_(kUsualSetting) {
  MR_ASSERT(model_ && fps_ > 0);
  observed_.layers = layers;
  set_lattice(kBits);
  set_target(target_mbps);
}

void Controller::set_target(double mbps) {
  const double wanted = std::isfinite(mbps) ? std::max(mbps, kLeast_mbps) : kLeast_mbps;
  target_changed_ |= std::abs(wanted - target_mbps_) > 0.02 * target_mbps_;
  if (wanted < target_mbps_ && credit_ > 0)  // was saved from what there is no more
    credit_ = wanted > 0.9 * target_mbps_ ? credit_ * wanted / target_mbps_ : 0;
  const bool is_less = wanted < target_mbps_;
  target_mbps_ = wanted;
  if (is_less) purse_ = std::min(purse_, largest_piece());  // was saved from what there is no more
}

void Controller::set_lattice(int bits) { observed_.bits = setting_.bits = bits; }

void Controller::set_features(std::vector<Feature> features) {
  observed_.features = std::move(features);
}

void Controller::set_fps(double fps) {
  MR_ASSERT(fps > 0);
  fps_ = fps;
}

void Controller::set_least_error(double voxels) {
  // Where it was this limit that held, another setting may be better now.
  target_changed_ |= voxels < observed_.least_error_voxels &&
                     setting_.error_voxels <= observed_.least_error_voxels;
  observed_.least_error_voxels = voxels;
  keep_within_limits();
}

void Controller::set_coarsest_error(double voxels) {
  observed_.coarsest_error_voxels = voxels;
  keep_within_limits();
}

double Controller::within_limits(double error_voxels) const {
  return std::min(std::max(error_voxels, observed_.least_error_voxels),
                  observed_.coarsest_error_voxels);
}

void Controller::keep_within_limits() {
  Setting allowed = setting_;
  allowed.error_voxels = within_limits(setting_.error_voxels);
  if (allowed != setting_) take(allowed);
}

/// Texture bytes of the next capture with a quantiser.
double Controller::texture_at(int qp, bool key_frame) const {
  return (key_frame ? key_ : texture_) * std::exp(-kPerQp * (qp - setting_.qp));
}

/// Bytes that the next capture may take: the target's share with what was saved or overdrawn, and
/// no more than the second that ends with it has left. Captures of the past count by their own
/// target.
double Controller::allowed() const {
  return std::max(std::min(bytes_of(target_mbps_) + credit_ / kRepay, left() - purse_), 0.0);
}

/// What of a capture's share is for the backlog.
double Controller::for_backlog(double backlog) const {
  return std::min(backlog_share_ * bytes_of(target_mbps_), purse_room(backlog));
}

double Controller::purse_room(double backlog) const {
  return std::max(std::min(largest_piece(), backlog) - purse_, 0.0);
}

/// As much as a second has room for, beside what moves: more could not be spent at once. But all of
/// a capture, where these come seldom.
double Controller::largest_piece() const {
  const double share = backlog_share_ > 0 ? backlog_share_ : kUsualBacklogShare;
  return std::max((share + kPurseAbove) * fps_, 1.0) * bytes_of(target_mbps_);
}

/// A purse that became too large goes back to what moves.
void Controller::limit_purse() {
  const double over = std::max(purse_ - largest_piece(), 0.0);
  purse_ -= over, credit_ += over;
}

double Controller::left() const {
  const double share = bytes_of(target_mbps_);
  double left = kMostInASecond * share * (fps_ - static_cast<double>(second_.size()));
  for (const Spent& spent : second_) left += kMostInASecond * spent.share - spent.bytes;
  return left;
}

/// What the setting in force takes with another quantiser.
double Controller::mbps_at(int qp) const {
  return mbps_of(geometry_ + texture_ * std::exp(-kPerQp * (qp - setting_.qp)));
}

/// Whether even the finest quantiser of the setting in force leaves some of a rate: by what it is
/// expected to take, or as it did for some captures.
bool Controller::is_idle(double mbps) const {
  const bool is_saved = credit_ > 0.6 * kMostCredit * bytes_of(target_mbps_);
  return mbps_at(kFinestQp) < 0.9 * mbps || (at_finest_ >= kDecideEvery && is_saved);
}

/// A change is urgent where the setting does not fit, or where the target has changed.
bool Controller::is_worth_it(const Setting& wanted, double budget_mbps) const {
  if (wanted == setting_) return false;
  if (!has_chosen_ || target_changed_) return true;
  const double needed = mbps_of(geometry_ + texture_);
  const bool is_reversal = direction_ != 0 && direction_of(setting_, wanted) != direction_;
  const bool is_urgent = needed > 1.3 * budget_mbps || mbps_at(kCoarsestQp) > budget_mbps;
  if (is_urgent)
    return mbps_of(expected_geometry(wanted) + expected_texture(wanted)) < kHelps * needed;
  if ((direction_of(setting_, wanted) > 0) == (needed > budget_mbps)) return false;
  const bool idle = is_idle(budget_mbps);
  if (idle && (wanted.error_voxels > setting_.error_voxels || wanted.scale < setting_.scale))
    return false;
  const bool is_held = is_reversal && !idle && !has_scene_changed();
  const double hold_s = is_held ? kHoldReversal_s : kHold_s;
  if (since_change_ < hold_s * fps_) return false;
  const bool is_free = idle && wanted.scale == setting_.scale;  // no key frame
  return is_free || needed > 1.1 * budget_mbps || needed < 0.7 * budget_mbps;
}

/// Whether the setting in force needs much more or less than when it was new: what spoke for it
/// then does no more.
bool Controller::has_scene_changed() const {
  const double by = first_needed_ > 0 ? (geometry_ + texture_) / first_needed_ : 1;
  return by < kOtherNeed || by > 1 / kOtherNeed;
}

/// Bytes of a capture with another setting, judged by what the one in force takes.
double Controller::expected_geometry(const Setting& setting) const {
  return geometry_ * std::pow(setting.error_voxels / setting_.error_voxels, -kErrorPower);
}
double Controller::expected_texture(const Setting& setting) const {
  return texture_ * std::exp(-kPerQp * (setting.qp - setting_.qp)) *
         std::pow(setting.scale / setting_.scale, 1.5);
}

void Controller::take(const Setting& setting) {
  direction_ = direction_of(setting_, setting);
  // Until captures of the new setting come.
  const double texture = expected_texture(setting);
  key_ *= texture_ > 0 ? texture / texture_ : 1;
  texture_ = texture, geometry_ = expected_geometry(setting);
  key_frame_needed_ |= setting.scale != setting_.scale;
  setting_ = setting, captures_ = textures_ = 0, since_change_ = 0, first_needed_ = 0;
}

/// Whether even the best quality leaves half of a rate: next to nothing moves. Models were trained
/// on scenes in which something does.
bool Controller::has_ample(double mbps) const {
  if (captures_ < kFewest) return false;
  const double geometry = geometry_ * setting_.error_voxels / kFinestSetting.error_voxels;
  const double texture =
      texture_at(kFinestQp, false) * std::pow(kFinestSetting.scale / setting_.scale, 2);
  return mbps_of(geometry + texture) < 0.5 * mbps;
}

/// Tells the model what the setting in force produces. Where captures are left out, waiting for
/// more of them takes long.
void Controller::note_produced() {
  if (captures_ < (is_best_effort_ ? kFewestAtWorst : kFewest)) return;
  const double key = key_ > 0 ? key_ : kUsualKey * texture_;
  observed_.produced.push_back(
      {setting_, geometry_ * 8e-6 * nominal_fps_, (texture_ * (nominal_fps_ - 1) + key) * 8e-6});
  if (observed_.produced.size() > 6) observed_.produced.erase(observed_.produced.begin());
}

/// Lets the model choose for a rate.
void Controller::decide(double for_setting_mbps) {
  if (captures_ >= kFewest && first_needed_ <= 0) first_needed_ = geometry_ + texture_;
  Setting wanted = kFinestSetting;
  if (!has_ample(for_setting_mbps))
    wanted = model_->choose(observed_, for_setting_mbps * nominal_fps_ / fps_);
  wanted.bits = setting_.bits;
  // What the model expects of finer pictures may be wrong: finer meshes by steps use what is left.
  if (captures_ >= kFewest && is_idle(for_setting_mbps) && direction_of(setting_, wanted) <= 0) {
    wanted = setting_;
    wanted.error_voxels = std::max(setting_.error_voxels / kFinerMesh, kFinestSetting.error_voxels);
  }
  wanted.error_voxels = within_limits(wanted.error_voxels);
  if (is_worth_it(wanted, for_setting_mbps)) take(wanted);
  has_chosen_ = true, target_changed_ = false, since_decision_ = 0;
}

/// Lets the model choose the backlog's share. That rises gently, so that what moves does not become
/// coarse at once.
void Controller::share_out(const Backlog& waiting) {
  constexpr double kRise = 0.05;
  const double wanted =
      model_->backlog_share(observed_, waiting, target_mbps_ * nominal_fps_ / fps_);
  const double most = backlog_share_ > 0 ? backlog_share_ + kRise : kUsualBacklogShare;
  backlog_share_ = std::min(wanted, most);
  limit_purse();
}

CapturePlan Controller::begin(const Backlog& waiting, double extra) {
  const double share = bytes_of(target_mbps_), backlog = waiting.bytes();
  const bool is_due = target_changed_ || since_decision_ >= kDecideEvery;
  if (is_due) note_produced();
  if (backlog <= 0) backlog_share_ = 0;
  if (backlog > 0 && (is_due || backlog_share_ <= 0)) share_out(waiting);
  const double aside = for_backlog(backlog);
  if (is_due) decide(mbps_of(share - aside));
  ++since_decision_, ++since_change_;

  // Where the least is more than the share, captures wait until what was saved pays for one.
  const double least = geometry_ + extra + texture_at(kCoarsestQp, key_frame_needed_);
  const double saved = std::min(share + credit_, left());  // not for the purse's sake
  is_best_effort_ = geometry_ + texture_at(kCoarsestQp, false) > 1.1 * share;
  const double room = std::max(left() - purse_ - least, 0.0);
  planned_ = {setting_, key_frame_needed_, false,
              std::min(backlog, purse_ + std::min(aside, room))};
  // A setting that is new is judged by what the one before it took: with reserve.
  const double sure = captures_ >= kFewest || sent_ < kStart ? 1 : kReserve;
  planned_.skipped =
      sure * least > std::max(allowed(), saved) && since_sent_ + 1 < kLongestGap_s * fps_;
  since_sent_ = planned_.skipped ? since_sent_ + 1 : 0;
  if (planned_.skipped) {
    planned_.refinement = 0;
    purse_ += aside, credit_ -= aside;
  }
  return planned_;
}

CaptureBudget Controller::code(const CaptureState& capture) {
  const double most = allowed();
  const double for_texture = most - for_backlog(capture.backlog) - capture.geometry;
  int qp = kFinestQp;
  if (texture_ <= 0) qp = captures_ == 0 ? std::max(setting_.qp, kFirstQp) : qp_of_rest();
  if (texture_ > 0)
    while (qp < kCoarsestQp && texture_at(qp, capture.key_frame) > for_texture) ++qp;
  // A picture that was coarse until now takes more than the same one coded finely all along.
  if (sent_ > 0 && !capture.key_frame) qp = std::max(qp, budget_.qp - kFinerAtOnce);
  const double used = capture.geometry + texture_at(qp, capture.key_frame);
  save_for_backlog(capture.backlog, most - used);
  budget_ = {qp, std::clamp(std::min(purse_, left() - used), 0.0, capture.backlog),
             purse_room(capture.backlog) <= 0};
  return budget_;
}

/// Nothing has moved lately, and what will move next is not known: pictures become finer step by
/// step.
int Controller::qp_of_rest() const {
  return std::max(kFinestQp, std::min(budget_.qp, kUsualSetting.qp) - 1);
}

/// Puts what a capture leaves into the purse, as far as that may be filled; its share in any case.
void Controller::save_for_backlog(double backlog, double unused) {
  if (backlog <= 0) {
    credit_ += std::exchange(purse_, 0);
    return;
  }
  const double saved = std::clamp(std::max(unused, for_backlog(backlog)), 0.0, purse_room(backlog));
  purse_ += saved, credit_ -= saved;
}

void Controller::sent(const CaptureBytes& bytes) {
  const double all = bytes.geometry + bytes.texture + bytes.refinement;
  const double share = bytes_of(target_mbps_);
  second_.push_back({all, share});
  while (!second_.empty() && static_cast<double>(second_.size()) > fps_ - 1) second_.pop_front();
  const double of_purse = std::min(bytes.refinement, purse_);
  purse_ -= of_purse;
  credit_ = std::clamp(credit_ + share + of_purse - all, -fps_ * share,
                       (planned_.skipped ? fps_ : kMostCredit) * share);
  if (planned_.skipped) return;
  ++sent_;
  at_finest_ = budget_.qp <= kFinestQp ? at_finest_ + 1 : 0;
  const double texture = bytes.texture * std::exp(kPerQp * (budget_.qp - setting_.qp));
  const auto weight = [](int before) { return 1 / std::min<double>(before + 1, kMeanOver); };
  geometry_ += weight(captures_++) * (bytes.geometry - geometry_);
  if (bytes.key_frame) {
    key_ = texture, key_frame_needed_ = false;
    if (texture_ <= 0) texture_ = key_ / kUsualKey;
  } else {
    texture_ += weight(textures_++) * (texture - texture_);
    if (key_ <= 0) key_ = kUsualKey * texture_;
  }
}

void Controller::give_up() {
  planned_.skipped = true;
  sent({});
}

}  // namespace mr::rate
