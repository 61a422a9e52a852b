//! The samples of one tile: which cone is highest, and how others join it.
//!
//! **Input** the cones of a tile in preorder. **Output** what is seen at each sample.
//! **Notation** g level: the square of a cone's height, under 0 outside of it; r its radius; n its normal.
//! **Steps** 1. The highest cone at each sample (outside of all, the one of the highest level). 2. Cones of the same
//! branch that come near it share their normals and colours, so that a chain of cones looks like one tube. 3. Of each
//! other branch the highest cone joins: two levels that differ by less than k become max + (k − |Δg|)²/4k, which
//! rounds the corner in the outline and the crease in the surface at once. k = 2 κ r₁ √(r₁ r₂) sin(½∠(n₁, n₂)), r₁ ≤ r₂:
//! where surfaces run on into each other nothing is added. k fades where the path between the two places along the
//! tree is long. 4. Where a cone in front passes over a distant part, leave a gap; where distant parts touch, draw a
//! seam.
//! **Guarantees** branches join in preorder, so the bytes do not depend on threads.
//! **Source** Joining by the angle of the gradients: [Gourmel2013]; the quadratic smooth maximum is folklore of
//! implicit modelling. Gaps and seams are ours.

use std::ops::Range;

use glam::{Vec2, Vec3};

use crate::cone::{Cone, Hit};
use crate::palette::Rgb;
use crate::raster::{Drawn, Job, NOTHING, TILE};

/// κ: the size of the fillets, in radii.
const FILLET: f32 = 0.7;
/// Two cones join if the path between them is at most this many of their radii; beyond, the fillets get smaller, and
/// from [`APART`] on they are distant parts.
const JOINED: f32 = 4.0;
const APART: f32 = 10.0;
/// How far a cone's colour reaches into another's, as a share of the square of its radius.
const COLOR_REACH: f32 = 0.8;
/// Where two distant parts of the map overlap at their widths, a dark line this wide says that they do not join.
const SEAM_PX: f32 = 1.3;
/// Width of the gap beside a branch that passes in front.
pub(crate) const GAP_PX: f32 = 1.6;
/// Samples per tile and axis at most: three for each pixel.
const MOST_SAMPLES: usize = 3 * TILE;

/// The best cone at a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Best {
    /// Where on the cone.
    pub hit: Hit,
    /// Which; [`NOTHING`] where none comes near.
    pub index: u32,
    /// Distance to the outline of all cones.
    outside: f32,
    /// How many cones come near.
    n_near: u32,
}

impl Best {
    const NOTHING: Self = Self { hit: Hit::NOTHING, index: NOTHING, outside: f32::INFINITY, n_near: 0 };

    fn offer(&mut self, index: u32, hit: Hit) {
        self.n_near += 1;
        // Inside goes before outside; there the higher is seen, beyond the outlines the nearer joins first.
        let rank = |hit: &Hit| if hit.level >= 0.0 { (1, hit.z) } else { (0, hit.level) };
        if self.index == NOTHING || rank(&hit) > rank(&self.hit) {
            (self.hit, self.index) = (hit, index);
        }
        self.outside = self.outside.min(hit.outside);
    }
}

/// The surface at a sample, of all cones that join there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// The square of its height.
    pub level: f32,
    /// The radius.
    pub radius: f32,
    /// From the axis to the sample.
    offset: Vec2,
    /// What light sees beside the bare shape: a chain of cones turns like one tube.
    bend: Vec3,
    /// How many cones of its branch have a say.
    n_chained: f32,
    color: Rgb,
    weight: f32,
    /// How much of the paper's colour is seen in the gap beside a branch that passes in front.
    pub gap: f32,
    /// How dark a seam is, 0 to 1.
    pub seam: f32,
    /// Distance to the outline, under 0 inside.
    pub outside: f32,
}

impl Surface {
    const NOTHING: Self = Self {
        level: 0.0,
        radius: 0.0,
        offset: Vec2::ZERO,
        bend: Vec3::ZERO,
        n_chained: 1.0,
        color: [0.0; 3],
        weight: 0.0,
        gap: 0.0,
        seam: 0.0,
        outside: f32::INFINITY,
    };

    fn of(job: &Job<'_>, best: &Best) -> Self {
        let edge = &job.drawn[best.index as usize];
        let hit = &best.hit;
        Self {
            level: hit.level,
            radius: hit.radius,
            offset: hit.offset,
            bend: bend(edge, hit),
            color: color(job, edge, hit),
            weight: 1.0,
            outside: best.outside,
            ..Self::NOTHING
        }
    }

    /// The mean colour.
    pub(crate) fn base(&self) -> Rgb {
        self.color.map(|part| part / self.weight.max(f32::MIN_POSITIVE))
    }

    /// The unit normal that light sees.
    pub(crate) fn normal(&self) -> Vec3 {
        (self.shape() + self.bend).normalize_or(Vec3::Z)
    }

    /// The unit normal of the bare shape; outside of the outline it lies in the plane.
    fn shape(&self) -> Vec3 {
        self.offset.extend(self.level.max(0.0).sqrt()).normalize_or(Vec3::Z)
    }

    /// Adds a colour by its weight.
    fn tint(&mut self, color: Rgb, weight: f32) {
        self.color = std::array::from_fn(|k| self.color[k] + weight * color[k]);
        self.weight += weight;
    }

    /// Takes in another cone of the same branch.
    fn chain(&mut self, edge: &Drawn, hit: &Hit, weight: f32) {
        self.n_chained += weight;
        let share = weight / self.n_chained;
        self.offset += share * (hit.offset - self.offset);
        self.bend += share * (bend(edge, hit) - self.bend);
    }

    /// Joins a cone of another branch whose level here is `level`; `share` of a whole fillet.
    fn join(&mut self, edge: &Drawn, hit: &Hit, level: f32, share: f32) {
        let half_sine = (0.5 * (1.0 - self.shape().dot(shape(hit)))).max(0.0).sqrt();
        let (small, large) = (self.radius.min(hit.radius), self.radius.max(hit.radius));
        let k = 2.0 * FILLET * small * (small * large).sqrt() * half_sine * share;
        let apart = (self.level - level).abs();
        if apart >= k {
            return;
        }
        let nearness = 1.0 - apart / k;
        let others = if level > self.level { 1.0 - 0.5 * nearness } else { 0.5 * nearness };
        self.offset += others * (hit.offset - self.offset);
        self.bend += others * (bend(edge, hit) - self.bend);
        self.radius += others * (hit.radius - self.radius);
        self.level = self.level.max(level) + 0.25 * k * nearness * nearness;
    }
}

fn shape(hit: &Hit) -> Vec3 {
    hit.offset.extend(hit.height).normalize_or(Vec3::Z)
}

/// What light sees beside the bare cone; nothing outside of the outline.
fn bend(edge: &Drawn, hit: &Hit) -> Vec3 {
    if hit.level > 0.0 { edge.cone.normal(hit) - shape(hit) } else { Vec3::ZERO }
}

fn color(job: &Job<'_>, edge: &Drawn, hit: &Hit) -> Rgb {
    job.palette.at(edge.values[0] + hit.share * (edge.values[1] - edge.values[0]))
}

/// Where samples lie: a square of pixels, some of them per pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    /// The upper left corner, pixels.
    pub origin: Vec2,
    /// Pixels per axis.
    pub n_pixels: usize,
    /// Samples per pixel and axis.
    pub n: usize,
}

impl Lattice {
    /// Samples per axis.
    pub(crate) fn row(self) -> usize {
        self.n_pixels * self.n
    }

    /// The indices of the samples from `low` to `high` along an axis on which the square begins at `from`.
    fn clip(self, low: f32, high: f32, from: f32) -> Range<usize> {
        let index = |at: f32| (at - from) * self.n as f32 - 0.5;
        // Casts saturate at 0; one sample of slack on either side covers rounding.
        let first = (index(low) - 1.0) as u32 as usize;
        let last = (index(high) + 2.0).max(0.0) as u32 as usize;
        first..last.min(self.row())
    }

    /// A sample's place along an axis.
    fn place(self, from: f32, index: usize) -> f32 {
        from + (index as f32 + 0.5) * (1.0 / self.n as f32)
    }

    /// A sample of a row whose place on the other axis is `y`.
    fn pixel(self, row: usize, sample: usize, y: f32) -> Vec2 {
        Vec2::new(self.place(self.origin.x, sample - row * self.row()), y)
    }

    /// Row by row, what a cone can reach when it is `margin` wider: the row, its place, its samples.
    fn runs(self, cone: &Cone, margin: f32) -> impl Iterator<Item = (usize, f32, Range<usize>)> + '_ {
        let (low, high) = cone.bounds();
        self.clip(low.y - margin, high.y + margin, self.origin.y).filter_map(move |row| {
            let y = self.place(self.origin.y, row);
            let (from, to) = cone.span(y, margin)?;
            let columns = self.clip(from, to, self.origin.x);
            let first = row * self.row();
            Some((row, y, first + columns.start..first + columns.end)).filter(|(.., run)| !run.is_empty())
        })
    }

    /// The distance from an outline at which a sample begins to be covered: half of it.
    fn fringe_px(self) -> f32 {
        0.5 / self.n as f32
    }

    /// The share of a sample that is covered, by the distance to the outline and the radius. A branch narrower than
    /// the sample ends within it on the other side too.
    pub(crate) fn coverage(self, surface: &Surface) -> f32 {
        let inside = |outside: f32| (0.5 - outside * self.n as f32).clamp(0.0, 1.0);
        inside(surface.outside) - inside(surface.outside + 2.0 * surface.radius)
    }
}

/// The samples of one square.
pub(crate) struct Samples {
    /// Where they lie.
    pub lattice: Lattice,
    /// What is highest.
    pub best: Vec<Best>,
    /// What is seen, wherever [`Self::best`] is something.
    pub surface: Vec<Surface>,
    /// By row: the samples outside of which nothing is.
    used: Vec<Range<usize>>,
    /// The highest cone of the branch in hand, by sample, and the samples that it comes near to.
    branch: Vec<Best>,
    touched: Vec<usize>,
}

impl Samples {
    /// Samples that see nothing.
    pub(crate) fn new() -> Self {
        let lattice = Lattice { origin: Vec2::ZERO, n_pixels: 0, n: 1 };
        Self {
            lattice,
            best: Vec::new(),
            surface: Vec::new(),
            used: Vec::new(),
            branch: Vec::new(),
            touched: Vec::new(),
        }
    }

    /// The pixels of a row outside of which nothing is.
    pub(crate) fn used_pixels(&self, row: usize) -> Range<usize> {
        let Lattice { n, .. } = self.lattice;
        let (first, rows) = (self.lattice.row(), self.used.get(row * n..(row + 1) * n).unwrap_or_default());
        let offset = |(i, range): (usize, &Range<usize>)| {
            let start = (row * n + i) * first;
            (range.start - start, range.end - start)
        };
        let used = rows.iter().enumerate().filter(|(_, range)| !range.is_empty()).map(offset);
        let (from, to) = used.fold((usize::MAX, 0), |all, own| (all.0.min(own.0), all.1.max(own.1)));
        from.min(to) / n..to.div_ceil(n)
    }

    /// Forgets what was drawn.
    fn clear(&mut self, lattice: Lattice) {
        for range in self.used.drain(..) {
            self.best[range].fill(Best::NOTHING);
        }
        self.lattice = lattice;
        let n_samples = lattice.row() * lattice.row();
        if self.best.len() < n_samples {
            self.best.resize(n_samples, Best::NOTHING);
            self.branch.resize(n_samples, Best::NOTHING);
            self.surface.resize(n_samples, Surface::NOTHING);
        }
        self.used.resize(lattice.row(), 0..0);
    }

    /// Draws the listed cones. Without `joins`, each cone stands for itself.
    pub(crate) fn draw(&mut self, job: &Job<'_>, list: &[u32], lattice: Lattice, joins: bool) {
        debug_assert!(lattice.row() <= MOST_SAMPLES, "the square is larger than a tile");
        self.clear(lattice);
        for &index in list {
            let cone = &job.drawn[index as usize].cone;
            let reach = reach_px(cone, job, lattice, joins);
            for (row, y, samples) in lattice.runs(cone, reach) {
                let used = &mut self.used[row];
                let from = if used.end == 0 { samples.start } else { used.start.min(samples.start) };
                *used = from..used.end.max(samples.end);
                for sample in samples {
                    if let Some(hit) = cone.at(lattice.pixel(row, sample, y), reach) {
                        self.best[sample].offer(index, hit);
                    }
                }
            }
        }
        for range in &self.used {
            for (best, surface) in self.best[range.clone()].iter().zip(&mut self.surface[range.clone()]) {
                if best.index != NOTHING {
                    *surface = Surface::of(job, best);
                }
            }
        }
        if joins {
            let branch_of = |&index: &u32| job.kinship.branch_of(job.drawn[index as usize].node);
            for of_branch in list.chunk_by(|a, b| branch_of(a) == branch_of(b)) {
                self.join(job, of_branch);
            }
            self.widen();
        }
    }

    /// Lets the cones of a branch join what they come near to.
    fn join(&mut self, job: &Job<'_>, of_branch: &[u32]) {
        let Self { lattice, best, surface, branch, touched, .. } = self;
        let node_of = |index: u32| job.drawn[index as usize].node;
        let Some(own) = of_branch.first().map(|&index| job.kinship.branch_of(node_of(index))) else { return };
        for &index in of_branch {
            let edge = &job.drawn[index as usize];
            let reach = reach_px(&edge.cone, job, *lattice, true);
            for (row, y, samples) in lattice.runs(&edge.cone, reach) {
                for sample in samples {
                    let winner = &best[sample];
                    if winner.n_near < 2 || winner.index == index {
                        continue;
                    }
                    let Some(hit) = edge.cone.at(lattice.pixel(row, sample, y), reach) else { continue };
                    if job.kinship.branch_of(node_of(winner.index)) == own {
                        let near = Near::new(job, winner, (index, hit), lattice.fringe_px());
                        near.chain(job, &mut surface[sample], winner);
                        continue;
                    }
                    if branch[sample].index == NOTHING {
                        touched.push(sample);
                    }
                    branch[sample].offer(index, hit);
                }
            }
        }
        for sample in touched.drain(..) {
            let Best { index, hit, .. } = std::mem::replace(&mut branch[sample], Best::NOTHING);
            let near = Near::new(job, &best[sample], (index, hit), lattice.fringe_px());
            near.meet(job, &mut surface[sample], &best[sample]);
        }
    }

    /// Moves the outlines by what the fillets add to the highest cones.
    fn widen(&mut self) {
        let edge_of = |level: f32, radius: f32| (radius * radius - level).max(0.0).sqrt() - radius;
        for range in &self.used {
            for (best, surface) in self.best[range.clone()].iter().zip(&mut self.surface[range.clone()]) {
                if best.index != NOTHING && surface.level > best.hit.level {
                    let moved =
                        edge_of(best.hit.level, best.hit.radius) - edge_of(surface.level, surface.radius);
                    surface.outside -= moved.max(0.0);
                }
            }
        }
    }
}

/// How far from its outline a cone is looked at.
fn reach_px(cone: &Cone, job: &Job<'_>, lattice: Lattice, joins: bool) -> f32 {
    let fringe_px = lattice.fringe_px();
    match (joins, job.has_depth) {
        (false, _) => fringe_px,
        (true, false) => cone.fillet_px().max(fringe_px),
        (true, true) => cone.fillet_px().max(GAP_PX),
    }
}

/// A cone at a sample that it comes near to, and how it stands to the highest one.
struct Near<'a> {
    edge: &'a Drawn,
    hit: Hit,
    /// Its level, measured from the axis of the highest: in space the axes may lie at different depths.
    level: f32,
    /// The sum of the radii.
    radii: f32,
    /// How much the two belong together: 1 in one neighbourhood of the tree, 0 in distant parts.
    kin: f32,
    fringe_px: f32,
}

impl<'a> Near<'a> {
    fn new(job: &Job<'a>, best: &Best, (index, hit): (u32, Hit), fringe_px: f32) -> Self {
        let (edge, winner) = (&job.drawn[index as usize], &job.drawn[best.index as usize]);
        let place = |edge: &Drawn, hit: &Hit| {
            (edge.node, edge.arc_px[0] + hit.share * (edge.arc_px[1] - edge.arc_px[0]))
        };
        let radii = hit.radius + best.hit.radius;
        let path = job.kinship.path_px(place(edge, &hit), place(winner, &best.hit), APART * radii);
        let kin = ((APART - path / radii) / (APART - JOINED)).clamp(0.0, 1.0);
        // Beyond the outline there is no surface whose depth would count.
        let behind = (hit.z - hit.height) - (best.hit.z - best.hit.height);
        let solid = (hit.height / hit.radius).min(1.0);
        let level = hit.level + 2.0 * hit.height * behind + solid * behind * behind.abs();
        Self { edge, hit, level, radii, kin, fringe_px }
    }

    /// How much of its normal and colour reaches the sample.
    fn weight(&self, best: &Best) -> f32 {
        let reach = COLOR_REACH * self.hit.radius * self.hit.radius;
        let fade = (1.0 - (best.hit.level.max(0.0) - self.level) / reach).clamp(0.0, 1.0);
        self.kin * self.edge.cone.say(&self.hit) * fade * fade
    }

    /// What a cone of the same branch does.
    fn chain(&self, job: &Job<'_>, surface: &mut Surface, best: &Best) {
        let weight = self.weight(best);
        if weight > 0.0 {
            surface.chain(self.edge, &self.hit, weight);
            surface.tint(color(job, self.edge, &self.hit), weight);
        } else if self.kin <= 0.0 {
            self.pass(job, surface, best);
        }
    }

    /// What the highest cone of another branch does.
    fn meet(&self, job: &Job<'_>, surface: &mut Surface, best: &Best) {
        if self.kin <= 0.0 {
            return self.pass(job, surface, best);
        }
        let weight = self.weight(best);
        if weight > 0.0 {
            surface.tint(color(job, self.edge, &self.hit), weight);
        }
        let say =
            self.kin * self.edge.cone.say(&self.hit) * job.drawn[best.index as usize].cone.say(&best.hit);
        surface.join(self.edge, &self.hit, self.level, say);
    }

    /// What a distant part does.
    fn pass(&self, job: &Job<'_>, surface: &mut Surface, best: &Best) {
        let hit = &self.hit;
        if hit.outside > self.fringe_px {
            // Beside the outline: a gap if this cone passes in front.
            if job.has_depth && hit.z > best.hit.z + 0.5 * self.radii {
                surface.gap = surface.gap.max((GAP_PX - hit.outside).clamp(0.0, 1.0));
            }
        } else {
            // The surfaces meet at an angle here, so the gap in height grows about as fast as the distance.
            let lower_px = best.hit.z - hit.z;
            surface.seam = surface.seam.max((1.0 - lower_px / SEAM_PX).clamp(0.0, 1.0));
        }
    }
}
