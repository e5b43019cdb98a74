#include "octrad/scene/pbrt/pbrt.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <set>

#include "octrad/base/error.h"
#include "octrad/base/input_file.h"
#include "octrad/base/join.h"
#include "octrad/base/lower_case.h"
#include "octrad/base/number_text.h"
#include "octrad/scene/make_element.h"
#include "octrad/scene/params.h"
#include "octrad/scene/pbrt/file.h"
#include "octrad/scene/pbrt/material.h"
#include "octrad/scene/pbrt/parts.h"
#include "octrad/scene/pbrt/shape.h"

namespace octrad {
namespace {

constexpr std::size_t kMostIncludes = 1000, kMostIncludeDepth = 16, kMostStates = 10000, kMostShapes = 4'000'000;
constexpr std::uint64_t kMostIncludedBytes = 1'000'000'000, kMostIncludedAgain = 100'000'000;
constexpr std::uint64_t kObjectBytes = 3000;  // of the elements of one, about
constexpr double kLeastDeterminant = 1e-18;

using Object = PbrtMaterials::Object;

class PbrtReader {
 public:
  PbrtReader(const std::string& file, std::string text, Description& description, SceneReport& report)
      : description_(description),
        report_(report),
        old_(has_world_end(text)),  // which version 4 has no more; the film knows better
        materials_(old_, description, report),
        meter_(file + ": the tree of the scene") {
    ask_memory(lexing_bytes(text), file);
    main_ = std::make_shared<const SourceFile>(file, std::move(text));
    description.root->location = {main_, 0};
  }

  void read() {
    group_ = description_.root.get();
    read_file_of(main_);
    if (!stack_.empty()) report_.assume(stack_.back().where, "the block that begins here ends with the file");
    flush_curves();
    materials_.add_bsdfs();
    remove_lights_of_nothing();
    for (const auto& [target, parameters] : attributes_) {
      for (const PbrtParameter& p : *parameters) {
        if (!p.used)
          report_.assume(p.where, "the parameter \"" + p.name + "\" of Attribute \"" + target + "\" is left out");
      }
    }
    report_.attempt(integrator_ ? integrator_->location() : Location(), [&] { add_integrator(); });
    if (camera_) {
      report_.attempt(camera_->location(), [&] {
        add_pbrt_sensor(*camera_, *camera_to_world_, film_.get(), filter_.get(), old_, *description_.root, report_);
      });
    }
  }

 private:
  // Of a text and the beginnings of its lines.
  static std::uint64_t lexing_bytes(const std::string& text) {
    return text.size() + 16 * static_cast<std::uint64_t>(std::count(text.begin(), text.end(), '\n'));
  }

  // Outside of comments and texts, at the beginning of a line.
  static bool has_world_end(const std::string& text) {
    for (std::size_t at = text.find("WorldEnd"); at != std::string::npos; at = text.find("WorldEnd", at + 1)) {
      std::size_t begin = at;
      while (begin > 0 && (text[begin - 1] == ' ' || text[begin - 1] == '\t')) --begin;
      if (begin == 0 || text[begin - 1] == '\n' || text[begin - 1] == '\r') return true;
      at = std::min(text.find('\n', at), text.size() - 1);
    }
    return false;
  }

  // What AttributeBegin keeps and AttributeEnd brings back.
  struct State {
    Transform ctm;
    bool reverse = false, at_start = true;  // transforms count for the beginning of the shutter time
    Object material, light;
    // By the target of Attribute; shared by the blocks that do not change them.
    std::shared_ptr<const std::map<std::string, PbrtObject::Defaults>> defaults;
  };
  struct Kept {
    State state;
    char kind;  // a: attributes, t: transforms, o: an object
    Location where;
  };
  using Handler = void (PbrtReader::*)(PbrtLexer&, const Location&);

  void read_file_of(const std::shared_ptr<const SourceFile>& source) {
    using R = PbrtReader;
    static const std::pair<std::string_view, Handler> kDirectives[] = {
        {"AttributeBegin", &R::attribute_begin},
        {"AttributeEnd", &R::attribute_end},
        {"TransformBegin", &R::transform_begin},
        {"TransformEnd", &R::transform_end},
        {"ObjectBegin", &R::object_begin},
        {"ObjectEnd", &R::object_end},
        {"ObjectInstance", &R::object_instance},
        {"Identity", &R::identity},
        {"Translate", &R::translate},
        {"Scale", &R::scale},
        {"Rotate", &R::rotate},
        {"LookAt", &R::look_at},
        {"Transform", &R::set_transform},
        {"ConcatTransform", &R::concat_transform},
        {"CoordinateSystem", &R::name_system},
        {"CoordSysTransform", &R::take_system},
        {"ActiveTransform", &R::active},
        {"TransformTimes", &R::times},
        {"ReverseOrientation", &R::reverse},
        {"WorldBegin", &R::world_begin},
        {"WorldEnd", &R::world_end},
        {"Include", &R::include},
        {"Import", &R::import},
        {"Attribute", &R::attribute},
        {"Camera", &R::camera},
        {"Film", &R::film},
        {"PixelFilter", &R::filter},
        {"Integrator", &R::integrator},
        {"SurfaceIntegrator", &R::integrator},
        {"Sampler", &R::skip},
        {"Renderer", &R::skip},  // of pbrt-v2
        {"VolumeIntegrator", &R::skip},
        {"Accelerator", &R::skip},
        {"Option", &R::option},
        {"ColorSpace", &R::color_space},
        {"Texture", &R::texture},
        {"Material", &R::material},
        {"MakeNamedMaterial", &R::make_named},
        {"NamedMaterial", &R::named},
        {"MakeNamedMedium", &R::medium},
        {"MediumInterface", &R::medium_interface},
        {"LightSource", &R::light},
        {"AreaLightSource", &R::area_light},
        {"Shape", &R::shape},
    };
    PbrtLexer lexer(source);
    while (lexer.peek().kind != PbrtToken::Kind::end) {
      const PbrtToken token = lexer.take();
      const Location where = lexer.location(token);
      const auto found = std::find_if(std::begin(kDirectives), std::end(kDirectives),
                                      [&](const auto& directive) { return directive.first == token.text; });
      if (token.kind != PbrtToken::Kind::word || found == std::end(kDirectives)) {
        std::vector<std::string> known;
        for (const auto& [name, handler] : kDirectives) known.emplace_back(name);
        const std::string word(token.text.substr(0, 60));
        fail(where, "\"" + word + "\" is no directive of pbrt" + did_you_mean(word, known));
      }
      (this->*found->second)(lexer, where);
    }
  }

  // The type and the parameters of an object that follow.
  Object object(PbrtLexer& lexer, const Location& where, const char* kind, const std::string& target = "") {
    const std::string type = lexer.text("a type");
    return object_of(lexer, where, kind, type, target);
  }
  Object object_of(PbrtLexer& lexer, const Location& where, const char* kind, const std::string& type,
                   const std::string& target) {
    PbrtParameters parameters = read_pbrt_parameters(lexer, meter_);
    for (PbrtParameter& p : parameters) p.serial = materials_.serial();
    meter_.add(sizeof(PbrtObject) + 100);
    PbrtObject::Defaults defaults;
    if (state_.defaults && state_.defaults->count(target)) defaults = state_.defaults->at(target);
    return std::make_shared<const PbrtObject>(kind, type, where, std::move(parameters), std::move(defaults));
  }

  // Blocks.
  void push(char kind, const Location& where) {
    if (stack_.size() == kMostStates) fail(where, "blocks are nested too deep");
    meter_.add(2 * sizeof(Kept));
    stack_.push_back({state_, kind, where});
  }
  void pop(char kind, const Location& where, const char* name) {
    if (stack_.empty() || stack_.back().kind != kind)
      fail(where, std::string(name) + " without its beginning" +
                      (stack_.empty() ? "" : "; another block begins at " + stack_.back().where.text()));
    if (kind == 't' && old_) {
      state_.ctm = stack_.back().state.ctm;
      state_.at_start = stack_.back().state.at_start;
    } else {
      state_ = std::move(stack_.back().state);
    }
    stack_.pop_back();
  }
  void attribute_begin(PbrtLexer&, const Location& w) { push('a', w); }
  void attribute_end(PbrtLexer&, const Location& w) { pop('a', w, "AttributeEnd"); }
  void transform_begin(PbrtLexer&, const Location& w) { push('t', w); }
  void transform_end(PbrtLexer&, const Location& w) { pop('t', w, "TransformEnd"); }

  void object_begin(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name");
    if (group_ != description_.root.get()) fail(where, "an object cannot stand in another one");
    push('o', where);
    // In version 3 a name stands for the last object that had it.
    if (groups_.count(name) && !old_) fail(where, "there is an object with the name \"" + name + "\" already");
    flush_curves();
    count_shape(where);
    const std::string id = "object" + std::to_string(objects_++);
    group_ = &add_element(*description_.root, where, "shape", {{"type", "shapegroup"}, {"id", id}});
    description_.ids.emplace(id, group_);
    groups_[name] = group_;
  }
  void object_end(PbrtLexer&, const Location& where) {
    pop('o', where, "ObjectEnd");
    flush_curves();
    group_ = description_.root.get();
  }
  void object_instance(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name");
    const auto found = groups_.find(name);
    report_.attempt(where, [&] {
      if (found == groups_.end())
        fail(where, "there is no object with the name \"" + name + "\"" + did_you_mean(name, keys_near(groups_, name)));
      if (group_ != description_.root.get()) fail(where, "an instance cannot stand in an object");
      const Element& group = *found->second;
      if (group.children.empty() || flat(where)) return;
      count_shape(where);
      Element& instance = add_element(*group_, where, "shape", {{"type", "instance"}});
      add_element(instance, where, "ref", {{"id", group.get("id")}});
      add_matrix(instance, where, "to_world", state_.ctm);
    });
  }

  // Transforms; each is applied before those that were given so far.
  void apply(const Transform& t, const Location& where) {
    if (!state_.at_start) {
      report_.assume(where, "animations are left out: everything stands as it does when the shutter opens");
      return;
    }
    state_.ctm = state_.ctm * t;
    if (!state_.ctm.is_affine()) fail(where, "the transform is not affine and finite");
  }
  void identity(PbrtLexer&, const Location&) {
    if (state_.at_start) state_.ctm = Transform();
  }
  static Vec3d three(PbrtLexer& lexer) {
    const double x = lexer.number("x"), y = lexer.number("y");
    return {x, y, lexer.number("z")};
  }
  void translate(PbrtLexer& lexer, const Location& w) { apply(Transform::translate(three(lexer)), w); }
  void scale(PbrtLexer& lexer, const Location& w) { apply(Transform::scale(three(lexer)), w); }
  void rotate(PbrtLexer& lexer, const Location& where) {
    const double angle = lexer.number("degrees");
    const Vec3d axis = three(lexer);
    if (!(length(axis) > 0.0) && angle != 0.0)
      report_.assume(where, "a rotation about an axis of length 0 changes nothing");
    apply(length(axis) > 0.0 ? Transform::rotate(axis, angle) : Transform(), where);
  }
  void look_at(PbrtLexer& lexer, const Location& where) {
    const Vec3d eye = three(lexer), target = three(lexer), up = three(lexer);
    const auto view = Transform::look_at(eye, target, up);
    if (!view) fail(where, "LookAt: the directions to the target and up must differ");
    apply(view->inverse(), where);
  }
  Transform matrix(PbrtLexer& lexer, const Location& where) {
    const std::vector<double> v = lexer.numbers(16, "of a matrix");
    Transform t;
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column) t(row, column) = v[static_cast<std::size_t>(4 * column + row)];
    }
    if (t(3, 3) != 0.0 && t(3, 3) != 1.0) {
      const double w = t(3, 3);
      for (double& x : t.m) x /= w;
    }
    if (std::fabs(t.m[12]) + std::fabs(t.m[13]) + std::fabs(t.m[14]) > 1e-6 || t(3, 3) != 1.0)
      report_.assume(where, "what a matrix does to the fourth coordinate is left out");
    t.m[12] = t.m[13] = t.m[14] = 0.0;
    t.m[15] = 1.0;
    if (!t.is_affine()) fail(where, "the matrix is not finite");
    return t;
  }
  void set_transform(PbrtLexer& lexer, const Location& where) {
    const Transform t = matrix(lexer, where);
    if (state_.at_start) state_.ctm = t;
  }
  void concat_transform(PbrtLexer& lexer, const Location& where) { apply(matrix(lexer, where), where); }
  void name_system(PbrtLexer& lexer, const Location&) {
    const std::string name = lexer.text("a name");
    meter_.add(sizeof(Transform) + name.size() + 100);
    systems_[name] = state_.ctm;
  }
  void take_system(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name");
    const auto found = systems_.find(name);
    if (found != systems_.end()) state_.ctm = found->second;
    else report_.assume(where, "CoordSysTransform with a name that there is not changes nothing");
  }
  void active(PbrtLexer& lexer, const Location& where) {
    const PbrtToken token = lexer.take();
    if (token.text != "StartTime" && token.text != "EndTime" && token.text != "All")
      fail(where, "ActiveTransform takes StartTime, EndTime or All");
    state_.at_start = token.text != "EndTime";
  }
  void times(PbrtLexer& lexer, const Location&) {
    lexer.number("start time");
    lexer.number("end time");
  }
  void reverse(PbrtLexer&, const Location&) { state_.reverse = !state_.reverse; }
  void world_begin(PbrtLexer&, const Location& where) {
    report_.attempt(where, [&] { materials_.exposure = exposure(); });
    state_.ctm = Transform();
    state_.at_start = true;
    systems_["world"] = state_.ctm;
  }
  void world_end(PbrtLexer&, const Location&) {}

  void include(PbrtLexer& lexer, const Location& where) {
    const std::string file = description_.resolve(lexer.text("a file"), where);
    if (open_files_ >= kMostIncludeDepth) fail(where, "Include: nested more than 16 deep");
    if (++includes_ > kMostIncludes) fail(where, "Include: more than 1000 files");
    std::string text = read_pbrt_file(file, kMostIncludedBytes);
    included_bytes_ += text.size();
    std::error_code code;
    if (!included_.insert(std::filesystem::weakly_canonical(file, code).string()).second) again_bytes_ += text.size();
    if (included_bytes_ > kMostIncludedBytes) fail(where, "Include: more than a gigabyte in all");
    if (again_bytes_ > kMostIncludedAgain)
      fail(where, "Include: more than 100 megabytes of files that were included before");
    ask_memory(lexing_bytes(text), file);
    ++open_files_;
    read_file_of(std::make_shared<const SourceFile>(file, std::move(text)));
    --open_files_;
  }

  // What the file leaves open and changes is its own.
  void import(PbrtLexer& lexer, const Location& where) {
    const State before = state_;
    const std::size_t open = stack_.size();
    include(lexer, where);
    if (stack_.size() != open) fail(where, "Import: the blocks of the file are not closed");
    state_ = before;
  }

  void attribute(PbrtLexer& lexer, const Location& where) {
    const std::string target = lexer.text("a target");
    if (target != "shape" && target != "light" && target != "material" && target != "texture" && target != "medium")
      fail(where, "Attribute sets parameters of shape, light, material, medium or texture, not of \"" + target + "\"");
    PbrtParameters parameters = read_pbrt_parameters(lexer, meter_);
    for (PbrtParameter& p : parameters) p.serial = materials_.serial();
    auto changed = state_.defaults ? *state_.defaults : std::map<std::string, PbrtObject::Defaults>();
    PbrtObject::Defaults& all = changed[target];
    all.push_back(std::make_shared<const PbrtParameters>(std::move(parameters)));
    if (target != "medium") attributes_.emplace_back(target, all.back());
    std::size_t count = 0, numbers = 0;
    for (const auto& list : all) {
      ++count;  // also where it is empty
      for (const PbrtParameter& p : *list) ++count, numbers += p.numbers.size();
    }
    if (count > 100 || numbers > 1000)
      fail(where, "Attribute: more than 100 parameters or 1000 numbers of the target \"" + target + "\"");
    state_.defaults = std::make_shared<const std::map<std::string, PbrtObject::Defaults>>(std::move(changed));
  }

  // Options of the scene.
  void camera(PbrtLexer& lexer, const Location& where) {
    camera_ = object(lexer, where, "Camera");
    if (state_.ctm.is_singular(kLeastDeterminant)) fail(where, "the transform of the camera is singular");
    camera_to_world_ = state_.ctm.inverse();
    systems_["camera"] = *camera_to_world_;
  }
  void film(PbrtLexer& lexer, const Location& where) {
    film_ = object(lexer, where, "Film");
    // Each version has types of its own.
    const std::string& type = film_->type();
    if (type == "image") old_ = true;
    if (type == "rgb" || type == "gbuffer" || type == "spectral") old_ = false;
    materials_.set_version(old_);
  }
  void filter(PbrtLexer& lexer, const Location& where) { filter_ = object(lexer, where, "PixelFilter"); }
  void integrator(PbrtLexer& lexer, const Location& where) { integrator_ = object(lexer, where, "Integrator"); }
  void skip(PbrtLexer& lexer, const Location& where) { object(lexer, where, "(skipped)"); }
  void option(PbrtLexer& lexer, const Location& where) {  // such as "string rendercoordsys" "world", or "seed" 42
    lexer.text("an option");
    const bool list = lexer.peek().kind == PbrtToken::Kind::open;
    do {
      if (lexer.take().kind == PbrtToken::Kind::end) fail(where, "Option needs a value");
    } while (list && lexer.peek().kind != PbrtToken::Kind::close);
    if (list) lexer.take();
  }
  void color_space(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name");
    if (name != "srgb") report_.assume(where, "colours of the space " + name + " are read as those of srgb");
  }

  // By what the film multiplies.
  double exposure() {
    if (!film_) return 1.0;
    if (old_) return film_->number("scale", 1.0, 0.0, 1e12);
    const double open = camera_ ? camera_->number("shutteropen", 0.0) : 0.0,
                 close = camera_ ? camera_->number("shutterclose", 1.0) : 1.0;
    const double factor = (close - open) * film_->number("iso", 100.0, 0.0, 1e12) / 100.0;
    if (!(factor > 0.0)) {
      report_.assume(film_->location(), "a shutter that is not open, or an iso of 0, counts as 1: all would be black");
      return 1.0;
    }
    if (std::fabs(factor - 1.0) > 1e-6)
      report_.assume(film_->location(),
                     "lights are multiplied by what the film's iso and the shutter time make of them");
    return factor;
  }

  void add_integrator() {
    static const PbrtObject standard("Integrator", "path", Location());
    const PbrtObject& integrator = integrator_ ? *integrator_ : standard;
    const Location where = integrator.location();
    const std::string& type = integrator.type();
    Element& e = add_element(*description_.root, where, "integrator", {{"type", "path"}});
    if (type != "path" && type != "volpath" && type != "simplepath" && type != "bdpt")
      report_.assume(where, "Integrator \"" + type + "\" read as path");
    // pbrt counts bounces, Mitsuba the segments of a path.
    const bool direct = type == "directlighting";
    const double bounces = direct ? 1.0 : integrator.number("maxdepth", 5.0, 0.0, 1e9);
    add_element(e, where, "integer",
                {{"name", "max_depth"}, {"value", std::to_string(static_cast<long>(bounces) + 1)}});
  }

  // Materials and textures.
  void texture(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name"), kind = lexer.text("float or spectrum");
    if (kind != "float" && kind != "spectrum" && kind != "color")
      fail(where, "a texture is one of float or spectrum, not of \"" + kind + "\"");
    materials_.add_texture(kind == "float", name, object(lexer, where, "Texture", "texture"));
  }
  void material(PbrtLexer& lexer, const Location& where) {
    state_.material = object(lexer, where, "Material", "material");
  }
  void make_named(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name");
    Object m = object_of(lexer, where, "MakeNamedMaterial", "", "material");
    const std::string type = m->text("type", "");
    materials_.add_named(name, std::make_shared<const PbrtObject>(m->with_type("Material", type)));
  }
  void named(PbrtLexer& lexer, const Location& where) {
    const std::string name = lexer.text("a name");
    state_.material = nullptr;
    report_.attempt(where, [&] { state_.material = materials_.named_for_shapes(name, where); });
  }
  void medium(PbrtLexer& lexer, const Location& where) {
    object(lexer, where, "Medium");  // refused where something uses it
  }
  void medium_interface(PbrtLexer& lexer, const Location& where) {
    bool any = false;
    for (int i = 0; i < 2 && lexer.peek().kind == PbrtToken::Kind::text; ++i) any |= !lexer.take().text.empty();
    if (any) report_.attempt(where, [&] { fail(where, std::string("a medium") + kNoMedia); });
  }

  void light(PbrtLexer& lexer, const Location& where) {
    const Object o = object(lexer, where, "LightSource", "light");
    if (group_ != description_.root.get()) {
      report_.assume(where, "lights in objects are left out, as in pbrt");
      return;
    }
    count_shape(where);
    report_.attempt(where, [&] { add_pbrt_light(*o, state_.ctm, old_, materials_, description_, report_); });
  }

  void area_light(PbrtLexer& lexer, const Location& where) {
    state_.light = object(lexer, where, "AreaLightSource", "light");
  }

  // Shapes.
  void count_shape(const Location& where) {
    if (++shapes_ > kMostShapes) fail(where, "the scene has more than 4 million shapes, instances and lights");
    meter_.add(kObjectBytes);
  }
  bool flat(const Location& where) {
    if (!std::isfinite(state_.ctm.determinant())) fail(where, "the shape is too large: coordinates may be up to 1e9");
    if (!state_.ctm.is_singular(kLeastDeterminant)) return false;
    report_.assume(where, "a shape that is scaled to nothing shows nothing");
    return true;
  }

  void shape(PbrtLexer& lexer, const Location& where) {
    const Object o = object(lexer, where, "Shape", "shape");
    count_shape(where);
    report_.attempt(where, [&] {
      if (!flat(where)) add_shape(*o);
    });
  }

  // A sphere of pbrt whose transform keeps it one.
  bool is_round(const PbrtObject& s) const {
    if (s.type() != "sphere" || s.has("zmin") || s.has("zmax") || s.has("phimax")) return false;
    const Transform& t = state_.ctm;
    const double l = length(t.column(0));
    for (int i = 0; i < 3; ++i) {
      const Vec3d a = t.column(i), b = t.column((i + 1) % 3);
      if (std::fabs(length(a) - l) > 1e-6 * l || std::fabs(dot(a, b)) > 1e-6 * l * l) return false;
    }
    return true;
  }

  void add_shape(const PbrtObject& s) {
    const Location where = s.location();
    const std::string& type = s.type();
    const bool mirrored = state_.ctm.determinant() < 0.0, in_group = group_ != description_.root.get();
    bool flip = state_.reverse;
    if (type == "curve") {
      const std::string bsdf = materials_.bsdf(state_.material, s);
      if (state_.light) report_.assume(where, "curves do not shine");
      Curves curves = pbrt_curves(s, state_.ctm, report_);
      auto& [first, all] = curves_.try_emplace(bsdf, where, Curves()).first->second;
      for (auto& curve : curves) {
        meter_.add(8 * sizeof(CurvePoint));
        all.push_back(std::move(curve));
      }
      s.note_unused(report_);
      return;
    }
    // Lights have one side: one on both is two, a little apart, each towards where its front is.
    const bool shines = state_.light && !in_group, both = shines && state_.light->flag("twosided", false),
               measured = shines && state_.light->has("power");
    double area = -1.0, grow = 0.0;
    std::string mesh, file, back;
    bool faces = false;  // without normals of its own
    const PbrtObject* const m = state_.material.get();
    const bool textured = s.has_textures() || (state_.light && state_.light->has("filename")) ||
                          (m && (m->has_textures() || m->has("normalmap") || m->type() == "mix" ||
                                 materials_.is_promise(state_.material)));
    if (is_round(s)) {
      const double scale = length(state_.ctm.column(0)), radius = s.number("radius", 1.0, 1e-9, 1e9);
      area = 4.0 * std::numbers::pi * radius * radius * scale * scale;
      if (both) grow = to_front(kSideApart * 2.0 * std::numbers::sqrt3);  // of the radius
      flip = flip != mirrored;                                            // Mitsuba turns a mirrored sphere inside out
    } else if (type == "plymesh") {
      file = absolute_path(description_.resolve(s.text("filename", ""), s.where("filename")));
      try {
        const bool packed = ending_of(file) == ".gz";
        const std::set<std::string> has = packed ? std::set<std::string>() : ply_properties(file);
        const bool coordinates = std::any_of(has.begin(), has.end(), is_ply_coordinate);
        if (packed || both || measured || (textured && !coordinates)) {
          std::error_code code;
          const std::string identity = std::filesystem::weakly_canonical(file, code).string();
          std::string& known = made_[identity];
          if (known.empty()) known = keep(read_pbrt_ply(file));
          mesh = known;
          if (textured && description_.built_mesh(known)->uvs.empty()) {
            std::string& apart = made_["with coordinates " + identity];
            if (apart.empty()) apart = keep(with_own_uvs(*description_.built_mesh(known)));
            mesh = apart;
          }
          if (both) {
            const std::string at_rest = mesh;
            const double apart = to_front(front_share(*description_.built_mesh(at_rest)));
            back = moved(at_rest, -apart);
            mesh = moved(at_rest, apart);
          }
        } else {
          faces = has.count("nx") == 0;
        }
      } catch (const InputError& error) {
        fail(s.where("filename"), error.what());
      } catch (const IoError& error) {
        throw IoError(s.where("filename").text() + ": " + error.what());
      }
    } else {
      // Shapes that numbers describe are made once for the same ones.
      const std::string key = is_quadric(type) && !both ? numbers_of(s) : "";
      if (const auto known = key.empty() ? made_.end() : made_.find(key); known != made_.end()) {
        mesh = known->second;
      } else {
        std::optional<RawMesh> raw = pbrt_mesh(s, subdivided_);
        if (!raw)
          fail(where, s.what() +
                          " is not supported; supported: trianglemesh, plymesh, bilinearmesh, loopsubdiv, sphere, "
                          "disk, cylinder, cone, paraboloid, hyperboloid, curve");
        if (raw->uvs.empty() && textured && (type == "trianglemesh" || type == "loopsubdiv")) *raw = with_own_uvs(*raw);
        if (both) {
          const double apart = to_front(front_share(*raw));
          back = keep(moved_along_normals(*raw, -apart));
          *raw = moved_along_normals(*raw, apart);
        }
        mesh = keep(std::move(*raw));
        if (!key.empty()) made_.emplace(key, mesh);
      }
    }
    if (measured && !mesh.empty()) {
      // Of one triangle or patch: in pbrt each is a light of its own.
      const RawMesh& made = *description_.built_mesh(mesh);
      const auto parts = static_cast<double>(made.triangles.size()) / (type == "bilinearmesh" ? 2.0 : 1.0);
      area = mesh_area(made, state_.ctm) / (is_quadric(type) ? 1.0 : parts);
    }
    if (!mesh.empty()) faces = description_.built_mesh(mesh)->normals.empty();
    if (faces && mirrored) flip = !flip;  // what mirrors turns the front with it; normals do so by themselves
    const std::string bsdf = materials_.bsdf(state_.material, s);
    if (both) add_surface(s, back, "", bsdf, faces, !flip, area, -grow);
    add_surface(s, mesh, file, bsdf, faces, flip, area, grow);
    if (state_.light && in_group) report_.assume(where, "lights in objects are left out, as in pbrt");
    const PbrtParameter* alpha = state_.light ? s.find("alpha") : nullptr;
    if (alpha && alpha->numbers.size() == 1 && alpha->numbers[0] <= 0.0)
      report_.assume(where, "a light whose alpha is 0 is seen; in pbrt it shines without being seen");
    s.note_unused(report_);
  }

  // Outwards, or inwards where the front is there.
  double to_front(double share) const { return state_.reverse ? -share : share; }
  // One that is kept with its vertices moved, once for each distance.
  std::string moved(const std::string& mesh, double share) {
    std::string& known = made_["moved by " + number_text(share) + " " + mesh];
    if (known.empty()) known = keep(moved_along_normals(*description_.built_mesh(mesh), share));
    return known;
  }

  // A mesh that is kept, one of a file, or a sphere, which may `grow` by a share of its radius.
  void add_surface(const PbrtObject& s, const std::string& mesh, const std::string& file, const std::string& bsdf,
                   bool faces, bool flip, double area, double grow) {
    const Location where = s.location();
    Element& e = add_element(*group_, where, "shape", {{"type", is_round(s) ? "sphere" : "ply"}});
    if (is_round(s)) {
      add_pbrt_value(e, where, "float", "radius", number_text(s.number("radius", 1.0) * (1.0 + grow)));
    } else {
      add_pbrt_value(e, where, "string", "filename", mesh.empty() ? file : mesh);
      if (mesh.empty()) add_pbrt_value(e, where, "boolean", "flip_tex_coords", "true");
      if (faces) add_pbrt_value(e, where, "boolean", "face_normals", "true");
    }
    add_matrix(e, where, "to_world", state_.ctm);
    if (flip) add_pbrt_value(e, where, "boolean", "flip_normals", "true");
    add_element(e, where, "ref", {{"id", bsdf}});
    const bool in_group = group_ != description_.root.get();
    if (!state_.light || in_group) return;
    if (materials_.is_promise(state_.material)) lit_.emplace_back(&e, state_.material);
    else if (shows_nothing(state_.material)) return note_no_light(where);
    materials_.add_emitter(e, state_.light, area);
  }

  // In version 4 such a surface does not shine either.
  bool shows_nothing(const Object& material) const { return !old_ && material && material->type() == "interface"; }
  void note_no_light(const Location& where) {
    report_.assume(where, "lights on an interface material are left out, as in pbrt");
  }
  void remove_lights_of_nothing() {
    for (const auto& [shape, material] : lit_) {
      Object m;
      report_.attempt(material->location(), [&, promise = material] { m = materials_.resolved(promise); });
      if (!shows_nothing(m)) continue;
      std::erase_if(shape->children, [](const auto& child) { return child->tag == "emitter"; });
      note_no_light(shape->location);
    }
  }

  static std::string numbers_of(const PbrtObject& s) {
    std::string text = "shape ";
    text += s.type();
    for (const char* name : {"radius", "zmin", "zmax", "phimax", "height", "innerradius", "p1", "p2"}) {
      const PbrtParameter* p = s.find(name, {"float", "integer", "point", "point3"});
      text.append(" ").append(name);
      for (std::size_t i = 0; p && i < p->numbers.size(); ++i) text.append(" ").append(number_text(p->numbers[i]));
    }
    return text;
  }

  std::string keep(RawMesh mesh) {
    meter_.add(mesh.bytes());
    const std::string name = "mesh" + std::to_string(description_.built->meshes.size());
    description_.built->meshes.emplace(name, std::move(mesh));
    return name;
  }

  // The curves so far, those of a material together.
  void flush_curves() {
    for (auto& [bsdf, found] : curves_) {
      auto& [where, curves] = found;
      const std::string name = "curves" + std::to_string(description_.built->curves.size());
      description_.built->curves.emplace(name, std::move(curves));
      Element& e = add_element(*group_, where, "shape", {{"type", "bsplinecurve"}});
      add_pbrt_value(e, where, "string", "filename", name);
      add_element(e, where, "ref", {{"id", bsdf}});
    }
    curves_.clear();
  }

  Description& description_;
  SceneReport& report_;
  bool old_;
  PbrtMaterials materials_;
  MemoryMeter meter_;
  std::shared_ptr<const SourceFile> main_;
  State state_;
  std::vector<Kept> stack_;
  std::vector<std::pair<std::string, std::shared_ptr<const PbrtParameters>>> attributes_;  // by their targets
  std::map<std::string, Transform> systems_;
  Object camera_, film_, filter_, integrator_;
  std::optional<Transform> camera_to_world_;
  Element* group_ = nullptr;  // to which shapes are added: the root or a group
  std::map<std::string, Element*> groups_;
  std::vector<std::pair<Element*, Object>> lit_;               // shapes that shine, of a material that is not known yet
  std::map<std::string, std::pair<Location, Curves>> curves_;  // by the id of their bsdf
  std::map<std::string, std::string> made_;                    // meshes, by the file or the numbers of which they are
  std::set<std::string> included_;
  double subdivided_ = 0.0;
  std::size_t includes_ = 0, shapes_ = 0, objects_ = 0, open_files_ = 1;
  std::uint64_t included_bytes_ = 0, again_bytes_ = 0;
};

}  // namespace

bool is_pbrt(const std::string& file) { return ending_of(file) == ".pbrt"; }

void read_pbrt(const std::string& file, std::string text, Description& description, SceneReport& report) {
  description.root = std::make_unique<Element>();
  description.root->tag = "scene";
  description.built = std::make_shared<BuiltFiles>();
  PbrtReader(file, std::move(text), description, report).read();
}

}  // namespace octrad
