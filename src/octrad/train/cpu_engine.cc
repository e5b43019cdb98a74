#include "octrad/base/threads.h"
#include "octrad/train/engine.h"

namespace octrad {
namespace {

class CpuEngine : public TrainEngine {
 public:
  CpuEngine(std::unique_ptr<BatchSource> batches, std::unique_ptr<RadianceField> field,
            std::unique_ptr<RadianceField> averages)
      : batches_(std::move(batches)),
        field_(std::move(field)),
        averages_(std::move(averages)) {
    query_ = [this](std::span<const SurfacePoint> points, std::span<Vec3f> out) { field_->radiance(points, out); };
  }

  void step(long long step, const ScheduleState& s) override {
    if (step % kGuideSteps == 0 && !batches_->guide().empty()) batches_->make_guide_tables();
    const TraceCounts counts = batches_->draw(static_cast<unsigned long long>(step), s, query_);
    const FieldStep done =
        field_->train(batches_->points(), batches_->targets(), s.epsilon, {s.rate_scale, s.network_scale});
    report_.losses.push_back(done.loss);
    report_.rhs_queries += static_cast<long long>(counts.queries);
    report_.dropped += static_cast<long long>(counts.non_finite);
    report_.non_finite += done.non_finite;
  }
  int steps_between_reports() const override { return 1; }
  StepReport collect() override {
    report_.empty_lookups = field_->take_empty_lookups();
    return std::exchange(report_, {});
  }
  void radiance(std::span<const SurfacePoint> points, std::span<Vec3f> out) override {
    parallel_blocks(points.size(), 512, [&](std::size_t begin, std::size_t end) {
      field().radiance(points.subspan(begin, end - begin), out.subspan(begin, end - begin));
    });
  }
  RadianceField& field() override { return averages_ ? *averages_ : *field_; }
  std::unique_ptr<RadianceField> release_field() override { return std::move(averages_ ? averages_ : field_); }
  RadianceField* trained() override { return averages_ ? field_.get() : nullptr; }
  void average(double share) override {
    if (averages_) approach(*averages_, *field_, static_cast<float>(share));
  }
  std::vector<FarEnd> far_ends() override { return batches_->far_ends(); }
  void set_far_ends(const std::vector<FarEnd>& far_ends) override { batches_->far_ends() = far_ends; }
  GuideState guide() override { return batches_->guide(); }
  void set_guide(const GuideState& guide) override { batches_->guide() = guide; }
  void set_target_scale(float scale) override {
    field_->set_target_scale(scale);
    if (averages_) averages_->set_target_scale(scale);
  }
  void scene_changed(std::unique_ptr<ChangedPoints> changed, double share) override {
    batches_->set_changed(std::move(changed), share);
  }
  void last_batch(std::vector<SurfacePoint>& points, std::vector<Vec3f>& targets) override {
    points = batches_->points();
    targets = batches_->targets();
  }

 private:
  std::unique_ptr<BatchSource> batches_;
  std::unique_ptr<RadianceField> field_, averages_;
  RadianceQuery query_;
  StepReport report_;
};

}  // namespace

std::unique_ptr<TrainEngine> make_cpu_engine(std::unique_ptr<BatchSource> batches, std::unique_ptr<RadianceField> field,
                                             std::unique_ptr<RadianceField> averages) {
  return std::make_unique<CpuEngine>(std::move(batches), std::move(field), std::move(averages));
}

}  // namespace octrad
