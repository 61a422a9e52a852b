//! Growing a tree that fills a space: each branch serves a cloud of points and forks so that its children serve
//! one half each.
//!
//! **Input** a start branch for each cloud, and [`Rules`]. **Output** the branches, added to a [`Shape`].
//! **Notation** d the direction at a branch's end, u the direction across d in which the cloud is split, r radius.
//! **Steps** breadth first, thick before thin:
//! 1. choose u: where the cloud is widest, with a bonus for 90° to the parent's fork;
//! 2. split the cloud across u at a random quantile between 0.35 and 0.65;
//! 3. give each child the radius r · share^(1/3), so that Σ r³ is kept (Murray's law);
//! 4. send each child towards the middle of its half, at a bounded angle, for a bounded multiple of its diameter;
//! 5. accept the pair if both ends lie inside and both keep their distance from all other branches, else turn u
//!    and try again, then try shorter children; if nothing fits, the branch stays a tip.
//!
//! **Guarantees** every fork has two children and keeps Σ r³; no two branches that are not neighbours come nearer
//! than the clearance; the result depends on the seed alone.
//! **Source** the split of the served cloud: [Tawhai2004]; rotating planes and flow-dividing radii:
//! [Kitaoka1999]; lengths of about three diameters: [Weibel1963].
//! **Cost** O(points · generations + branches²), the square being box tests.

use std::collections::VecDeque;
use std::f64::consts::PI;

use espalier_geom::math;
use espalier_geom::random::Stream;
use glam::DVec3;

use crate::clearance::Occupied;
use crate::shape::Shape;

/// How often a fork is tried at a length, each time with its plane turned further.
const N_TURNS: u32 = 12;
/// The lengths at which a fork is tried, as shares of the wanted one: near a wall shorter branches still fit.
const SHARES: [f64; 3] = [1.0, 0.75, 0.55];
/// Directions that are compared for the split, over a half turn.
const N_DIRECTIONS: u32 = 12;
/// The angles between a child and its parent's line, in radians: 12° to 65°.
const CHILD_ANGLE: [f64; 2] = [0.21, 1.13];
/// The least angle between siblings in radians: 69°. Below it a voxel mask may bridge the crotch.
const SIBLING_ANGLE: f64 = 1.2;
/// Length of a branch over its diameter.
const LENGTH_RATIO: [f64; 2] = [2.4, 4.8];
/// Share of the way to the middle of its cloud that a branch goes.
const REACH: f64 = 0.52;

/// What bounds the growth.
pub(crate) struct Rules<'a> {
    /// How deep a point lies inside the space to fill, in mm.
    pub(crate) depth: &'a dyn Fn(DVec3) -> f64,
    /// The deepest generation.
    pub(crate) generations: u32,
    /// The thinnest branch in mm.
    pub(crate) min_radius_mm: f64,
    /// The least space between surfaces in mm.
    pub(crate) clearance_mm: f64,
}

/// A branch whose end may fork.
pub(crate) struct Bud {
    /// The number of its branch among the occupied.
    pub(crate) branch: usize,
    /// Its last node.
    pub(crate) node: usize,
    /// The direction in which it arrives.
    pub(crate) direction: DVec3,
    /// The normal of the plane of the fork it came from.
    pub(crate) normal: DVec3,
    /// Its generation.
    pub(crate) generation: u32,
    /// What it serves.
    pub(crate) cloud: Vec<DVec3>,
}

/// A tree while it grows.
pub(crate) struct Growth<'a> {
    pub(crate) shape: &'a mut Shape,
    pub(crate) occupied: Occupied,
    pub(crate) stream: Stream,
}

/// A child that is not yet accepted.
struct Sprout {
    balls: Vec<(DVec3, f64)>,
    direction: DVec3,
    cloud: Vec<DVec3>,
}

impl Growth<'_> {
    /// Lets the buds fork until nothing more fits.
    pub(crate) fn grow(&mut self, buds: Vec<Bud>, rules: &Rules<'_>) {
        let mut queue = VecDeque::from(buds);
        while let Some(mut bud) = queue.pop_front() {
            if bud.generation >= rules.generations || bud.cloud.len() < 2 {
                continue;
            }
            if let Some([first, second]) = self.fitting_pair(&mut bud, rules) {
                let normal = first.direction.cross(second.direction).normalize_or(bud.normal);
                queue.push_back(self.plant(&bud, first, normal));
                queue.push_back(self.plant(&bud, second, normal));
            }
        }
    }

    /// The first pair of children that lies inside and keeps its distance, if there is one.
    fn fitting_pair(&mut self, bud: &mut Bud, rules: &Rules<'_>) -> Option<[Sprout; 2]> {
        let first_angle = self.widest_angle(bud);
        for (length_share, turn) in
            SHARES.iter().flat_map(|&share| (0..N_TURNS).map(move |turn| (share, turn)))
        {
            // Turn the plane to and fro about the best one.
            let swing = f64::from(turn.div_ceil(2)) * PI / f64::from(N_TURNS);
            let angle = first_angle + if turn % 2 == 0 { swing } else { -swing };
            let Some(pair) = self.sprout(bud, (angle, length_share), rules) else { continue };
            let is_clear = |s: &Sprout| self.occupied.is_clear(&s.balls[1..], bud.branch, rules.clearance_mm);
            if pair.iter().all(is_clear) {
                return Some(pair);
            }
        }
        None
    }

    /// Adds a chain from `hub` and returns its branch number and last node. `balls[0]` is the hub.
    pub(crate) fn add_branch(&mut self, hub: usize, balls: Vec<(DVec3, f64)>) -> (usize, usize) {
        let node = balls[1..].iter().fold(hub, |last, &(at, radius)| self.shape.push(Some(last), at, radius));
        (self.occupied.add(balls), node)
    }

    fn plant(&mut self, bud: &Bud, sprout: Sprout, normal: DVec3) -> Bud {
        let (branch, node) = self.add_branch(bud.node, sprout.balls);
        Bud {
            branch,
            node,
            direction: sprout.direction,
            normal,
            generation: bud.generation + 1,
            cloud: sprout.cloud,
        }
    }

    /// The angle about d, from the parent's fork normal, across which the cloud is best split.
    fn widest_angle(&mut self, bud: &Bud) -> f64 {
        let center = mean(&bud.cloud);
        let (across, along) = axes_about(bud.direction, bud.normal);
        let score = |step: u32| {
            let angle = PI * f64::from(step) / f64::from(N_DIRECTIONS);
            let u = across_at((across, along), angle);
            let spread: f64 = bud.cloud.iter().map(|p| (*p - center).dot(u) * (*p - center).dot(u)).sum();
            spread * (1.0 + 0.8 * math::cos(angle) * math::cos(angle))
        };
        let best = (0..N_DIRECTIONS).max_by(|&a, &b| score(a).total_cmp(&score(b)).then(b.cmp(&a)));
        PI * f64::from(best.unwrap_or(0)) / f64::from(N_DIRECTIONS) + self.stream.uniform(-0.12, 0.12)
    }

    /// The two children for a split across the direction at `angle`, if both end inside and are thick enough.
    fn sprout(
        &mut self,
        bud: &mut Bud,
        (angle, length_share): (f64, f64),
        rules: &Rules<'_>,
    ) -> Option<[Sprout; 2]> {
        let u = across_at(axes_about(bud.direction, bud.normal), angle);
        bud.cloud.sort_by(|p, q| q.dot(u).total_cmp(&p.dot(u)));
        let n_points = bud.cloud.len();
        let quantile = self.stream.uniform(0.35, 0.65);
        let n_first = ((quantile * n_points as f64) as usize).clamp(1, n_points - 1);
        let halves = [&bud.cloud[..n_first], &bud.cloud[n_first..]];
        let (hub, radius) = (self.shape.nodes[bud.node].position_mm, self.shape.nodes[bud.node].radius_mm);
        let radii = halves.map(|half| radius * math::cbrt(half.len() as f64 / n_points as f64));
        if radii[0].min(radii[1]) < rules.min_radius_mm {
            return None;
        }
        let middles = halves.map(mean);
        let directions = child_directions(bud.direction, u, middles.map(|middle| middle - hub));
        let mut child = |idx: usize| {
            let diameter = 2.0 * radii[idx];
            let wanted = (REACH * hub.distance(middles[idx]))
                .clamp(LENGTH_RATIO[0] * diameter, LENGTH_RATIO[1] * diameter);
            let length_mm = length_share * wanted * self.stream.uniform(0.9, 1.1);
            let path = Path { hub: (hub, radius), arrival: bud.direction, direction: directions[idx] };
            let balls = path.bent(length_mm, radii[idx], &mut self.stream);
            let (tip, before) = (balls[balls.len() - 1].0, balls[balls.len() - 2].0);
            let direction = (tip - before).normalize_or(directions[idx]);
            let is_inside = (rules.depth)(tip) > radii[idx] + rules.clearance_mm;
            is_inside.then(|| Sprout { balls, direction, cloud: halves[idx].to_vec() })
        };
        Some([child(0)?, child(1)?])
    }
}

/// How a branch leaves its hub.
pub(crate) struct Path {
    /// Position and radius of the hub.
    pub(crate) hub: (DVec3, f64),
    /// The direction in which the parent arrives there.
    pub(crate) arrival: DVec3,
    /// The direction in which the branch goes.
    pub(crate) direction: DVec3,
}

impl Path {
    /// A slightly bent branch: a quadratic Bézier curve that leaves a little towards the parent's line and bows a
    /// little to a random side. The flare from the hub's radius ends where the hub's ball does.
    pub(crate) fn bent(&self, length_mm: f64, radius_mm: f64, stream: &mut Stream) -> Vec<(DVec3, f64)> {
        let (start, hub_radius) = self.hub;
        let end = start + length_mm * self.direction;
        let leaving = (self.direction + 0.12 * self.arrival).normalize_or(self.direction);
        let (side, other) = axes_about(self.direction, self.arrival);
        let bow = length_mm * (stream.uniform(-0.05, 0.05) * side + stream.uniform(-0.05, 0.05) * other);
        let control = start + 0.5 * length_mm * leaving + bow;
        let flare_end = (0.95 * hub_radius / length_mm).clamp(0.08, 0.45);
        let n_steps = ((1.0 - flare_end) * length_mm / (1.2 * radius_mm)).ceil().clamp(2.0, 16.0) as u32;
        let at = |t: f64| start.lerp(control, t).lerp(control.lerp(end, t), t);
        let rest = (0..=n_steps).map(|step| {
            (at(flare_end + (1.0 - flare_end) * f64::from(step) / f64::from(n_steps)), radius_mm)
        });
        std::iter::once(self.hub).chain(rest).collect()
    }
}

/// The directions of two children: in the plane of d and u as far as their clouds ask for, within the bounds.
fn child_directions(d: DVec3, u: DVec3, towards: [DVec3; 2]) -> [DVec3; 2] {
    let w = d.cross(u);
    let mut angles = [0, 1].map(|idx: usize| {
        let side = if idx == 0 { 1.0 } else { -1.0 };
        math::atan2(side * towards[idx].dot(u), towards[idx].dot(d)).clamp(CHILD_ANGLE[0], CHILD_ANGLE[1])
    });
    let lack = (SIBLING_ANGLE - angles[0] - angles[1]).max(0.0);
    angles = angles.map(|angle| (angle + 0.5 * lack).min(CHILD_ANGLE[1]));
    [0, 1].map(|idx: usize| {
        let side = if idx == 0 { 1.0 } else { -1.0 };
        let (sin, cos) = math::sin_cos(angles[idx]);
        let out_of_plane = (towards[idx].dot(w) / towards[idx].length().max(1e-9)).clamp(-0.35, 0.35);
        (cos * d + side * sin * u + out_of_plane * w).normalize_or(d)
    })
}

/// Two unit vectors perpendicular to d and each other, the first as near to `hint` as it can be.
fn axes_about(d: DVec3, hint: DVec3) -> (DVec3, DVec3) {
    let (right, up) = espalier_geom::space::plane_axes(d, hint);
    (up, right)
}

fn across_at((first, second): (DVec3, DVec3), angle_rad: f64) -> DVec3 {
    let (sin, cos) = math::sin_cos(angle_rad);
    cos * first + sin * second
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().sum::<DVec3>() / points.len().max(1) as f64
}

/// `n_points` points spread evenly at random over a space inside a box; fewer if the space is hard to hit.
pub(crate) fn scatter(
    (low, high): (DVec3, DVec3),
    n_points: usize,
    depth: impl Fn(DVec3) -> f64,
    stream: &mut Stream,
) -> Vec<DVec3> {
    let mut points = Vec::with_capacity(n_points);
    for _ in 0..20 * n_points {
        let p = DVec3::new(
            stream.uniform(low.x, high.x),
            stream.uniform(low.y, high.y),
            stream.uniform(low.z, high.z),
        );
        if points.len() < n_points && depth(p) > 0.0 {
            points.push(p);
        }
    }
    points
}
