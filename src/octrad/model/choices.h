// What a configuration chooses between. The names that users write are in the key table (config.cc).
#pragma once

#include "octrad/base/lookup_rule.h"          // LookupDirection, RoughDirection: lookup.direction, .rough_direction
#include "octrad/network/activations_math.h"  // Activation: decoder.output, nr.output
#include "octrad/network/loss_math.h"         // LossNormalizer: loss.normalizer

namespace octrad {

enum class OctreeBox { axis, cube };                    // domain: bounding box normalised per axis, or its cube
enum class OctreeOccupancy { conservative, sampled };   // cells: all that a surface overlaps, or those hit by samples
enum class OctreeInterpolation { trilinear, nearest };  // between the cells of a level
enum class OctaInterpolation { barycentric, nearest };  // between the vertices of a cell's octahedral map
enum class LookupOffset { predicted, none, traced };    // disparity of queries: learned, 0 or 1/distance of a ray
enum class Reflected { none, features };                // of the surface that the offset's ray meets
enum class DisparityUnit { extent, world };             // 1/(largest side of the domain) or 1/world unit
enum class DecoderPosition { normalized, world };       // position input in [-1, 1] or in world units
enum class TargetEmission { outside, inside };          // own emission added to the network's output, or learned
enum class TargetDemodulation { none, albedo };         // albedo: the network predicts radiance / albedo
enum class Coats { joined, split };                     // split: a response for each lobe of a coated surface
enum class FreshDirection { cosine, uniform };          // density of the directions that glossy points are seen from
enum class TrainSampler { walks, area, mixture };       // left-hand-side points
enum class AdamMode { touched, dense };                 // entries of a table that a step updates
enum class DeltaSurfaces { cache, trace };              // perfect mirrors and glass when rendering
enum class Highlights { automatic, cache, bounce };     // glossy first hits of `lhs` below render.bounce_below

}  // namespace octrad
