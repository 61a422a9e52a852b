//! What to make: the kind of a phantom and its parameters.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest number of voxels a phantom may have: 512³. A CT of that size needs about 1 GB while it is made.
pub const MAX_VOXELS: usize = 512 * 512 * 512;

/// The largest number of nodes a phantom tree may have.
pub const MAX_NODES: usize = 1_000_000;

/// What a phantom shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A straight tube.
    Straight,
    /// Two legs that meet at a known angle, sharp or round.
    Bent,
    /// A helical tube.
    Helix,
    /// A stem and two branches at a known angle.
    Y,
    /// A ring: one loop.
    Torus,
    /// A long stem with teeth on one side.
    Comb,
    /// The airways of a human, in a thorax.
    Airway,
    /// A vein of the liver that follows Murray's law, in an abdomen.
    Vessel,
    /// A neuron: a tree only, at the scale of a tenth of a millimetre.
    Neuron,
}

impl Kind {
    /// All kinds, simple ones first.
    pub const ALL: [Self; 9] = [
        Self::Straight,
        Self::Bent,
        Self::Helix,
        Self::Y,
        Self::Torus,
        Self::Comb,
        Self::Airway,
        Self::Vessel,
        Self::Neuron,
    ];

    /// The name used in configurations, kebab case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Bent => "bent",
            Self::Helix => "helix",
            Self::Y => "y",
            Self::Torus => "torus",
            Self::Comb => "comb",
            Self::Airway => "airway",
            Self::Vessel => "vessel",
            Self::Neuron => "neuron",
        }
    }
}

/// How a phantom is made. Which keys a kind heeds stands with each key; the others do nothing for it.
///
/// The closed forms lie about the world's origin, their axis along `direction`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Distance between voxel centres along x, y, z, in mm, 0.0001 to 100. Default 1, 1, 1: an airway CT of
    /// 18 million voxels, made in seconds. Larger: coarser and faster. All kinds with a mask.
    pub spacing_mm: [f64; 3],
    /// Shift of the voxel grid against the body, in voxels, −1 to 1. Default 0, 0, 0. Tests sweep it to show
    /// that no result hangs on a lucky grid. All kinds with a mask.
    pub offset_voxels: [f64; 3],
    /// Empty space between the body and the border of the volume, in mm, 0 to 1000. Default 5. Two voxels are
    /// always kept. Closed forms; the anatomical scenes have their own extent.
    pub margin_mm: f64,
    /// Direction of the axis in RAS; any length but zero. Default 0, 0, 1 (feet to head). Closed forms.
    pub direction: [f64; 3],
    /// Rotation about the axis in degrees, −360 to 360. Default 0: bends and branches go to the right as far
    /// as the axis lets them. Closed forms.
    pub roll_deg: f64,
    /// Length in mm of a straight tube, of each leg of a bent one, of the stem and of each branch of a Y; above
    /// 0, to 100 000. Default 60.
    pub length_mm: f64,
    /// Radius of the tube in mm, above 0, to 1000. Default 4. Closed forms.
    pub radius_mm: f64,
    /// Radius at the tips as a share of the radius at the root, linear along the path, 0.05 to 1. Default 1.
    /// Smaller: more pointed. Closed forms but the torus.
    pub taper: f64,
    /// Distance between the nodes of the ground truth, in mm, above 0. Default 2. Smaller: more nodes, curves
    /// nearer to their closed form. Closed forms.
    pub step_mm: f64,
    /// By how much a bent tube turns, in degrees, 0 (straight on) to 170. Default 60.
    pub bend_angle_deg: f64,
    /// Radius of the bend in mm, 0 (sharp) to 10 000. Default 0. Larger: rounder and longer. Bent.
    pub bend_radius_mm: f64,
    /// Angle between the two branches of a Y in degrees, 5 to 175. Default 70.
    pub branch_angle_deg: f64,
    /// Share of that angle by which the first branch leaves the stem's line, 0 to 1. Default 0.5: symmetric;
    /// 0: the first branch goes straight on. Y.
    pub branch_share: f64,
    /// Radius of the ring or coil in mm (axis to centreline), above 0, to 10 000. Default 20. Torus, helix.
    pub ring_radius_mm: f64,
    /// Rise of a helix per turn in mm, above 0, to 10 000. Default 24.
    pub pitch_mm: f64,
    /// Turns of a helix, above 0, to 1000. Default 2.
    pub turns: f64,
    /// Teeth of a comb, 1 to 100 000. Default 8.
    pub n_teeth: usize,
    /// Length of a tooth in mm, from the stem's centreline, above 0, to 100 000. Default 25.
    pub tooth_length_mm: f64,
    /// Distance between neighbouring teeth in mm, above 0, to 100 000. Default 15. Comb.
    pub tooth_pitch_mm: f64,
    /// Scale of the anatomy, 0.2 to 3. Default 1: a small adult. Larger: a larger body with the same tree.
    /// Airway, vessel.
    pub size: f64,
    /// Deepest generation grown, the trunk being 0; 1 to 16. Default 8. Larger: more and finer branches, if
    /// `min_radius_mm` lets them. Airway, vessel.
    pub generations: u32,
    /// Thinnest branch grown, in mm at size 1, 0.2 to 5. Default 1.2: just over one voxel across the radius.
    /// Larger: a sparser tree. Airway, vessel.
    pub min_radius_mm: f64,
    /// Least space between the surfaces of branches that are not neighbours, in mm at size 1, 0 to 20. Default
    /// 2.5: two voxels and a half, so that the mask closes no false loop. Airway, vessel.
    pub clearance_mm: f64,
    /// Nodes of a neuron, exactly; 2 to 1 000 000. Default 235, the size of the paper's olfactory fibre.
    pub n_nodes: usize,
    /// Share of the voxels on either side of the surface that are flipped in the mask, 0 to 0.5. Default 0.
    /// Larger: a rougher mask, with loops, cavities and islands. All kinds with a mask.
    pub roughness: f64,
    /// Standard deviation of the CT's noise in HU, 0 to 1000. Default 25: a standard-dose chest CT.
    pub noise_hu: f64,
    /// Standard deviation of the scanner's point spread in mm, 0 to 20. Default 0.4. Larger: thin walls and
    /// thin branches fade. CT.
    pub blur_mm: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            spacing_mm: [1.0; 3],
            offset_voxels: [0.0; 3],
            margin_mm: 5.0,
            direction: [0.0, 0.0, 1.0],
            roll_deg: 0.0,
            length_mm: 60.0,
            radius_mm: 4.0,
            taper: 1.0,
            step_mm: 2.0,
            bend_angle_deg: 60.0,
            bend_radius_mm: 0.0,
            branch_angle_deg: 70.0,
            branch_share: 0.5,
            ring_radius_mm: 20.0,
            pitch_mm: 24.0,
            turns: 2.0,
            n_teeth: 8,
            tooth_length_mm: 25.0,
            tooth_pitch_mm: 15.0,
            size: 1.0,
            generations: 8,
            min_radius_mm: 1.2,
            clearance_mm: 2.5,
            n_nodes: 235,
            roughness: 0.0,
            noise_hu: 25.0,
            blur_mm: 0.4,
        }
    }
}

impl Params {
    /// Checks every key against its range.
    ///
    /// # Errors
    /// The first key that is out of its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        for spacing in self.spacing_mm {
            within("spacing_mm", spacing, 1e-4, 100.0)?;
        }
        for offset in self.offset_voxels {
            within("offset_voxels", offset, -1.0, 1.0)?;
        }
        for component in self.direction {
            within("direction", component, -1e6, 1e6)?;
        }
        let is_direction = self.direction.iter().any(|component| component.abs() > 1e-9);
        ParamError::check("direction", is_direction, "must not be the zero vector")?;
        for (key, value, low, high) in self.ranges() {
            within(key, value, low, high)?;
        }
        for (key, count, low, high) in [
            ("n_teeth", self.n_teeth, 1, 100_000),
            ("generations", self.generations as usize, 1, 16),
            ("n_nodes", self.n_nodes, 2, MAX_NODES),
        ] {
            let message = format!("must be from {low} to {high}, is {count}");
            ParamError::check(key, (low..=high).contains(&count), message)?;
        }
        Ok(())
    }

    /// The scalar keys with their values and ranges, in the order of the fields.
    fn ranges(&self) -> [(&'static str, f64, f64, f64); 21] {
        /// Stands for "above 0": nothing that a scan shows is smaller.
        const TINY: f64 = 1e-6;
        [
            ("margin_mm", self.margin_mm, 0.0, 1000.0),
            ("roll_deg", self.roll_deg, -360.0, 360.0),
            ("length_mm", self.length_mm, TINY, 1e5),
            ("radius_mm", self.radius_mm, TINY, 1000.0),
            ("taper", self.taper, 0.05, 1.0),
            ("step_mm", self.step_mm, TINY, 1e5),
            ("bend_angle_deg", self.bend_angle_deg, 0.0, 170.0),
            ("bend_radius_mm", self.bend_radius_mm, 0.0, 1e4),
            ("branch_angle_deg", self.branch_angle_deg, 5.0, 175.0),
            ("branch_share", self.branch_share, 0.0, 1.0),
            ("ring_radius_mm", self.ring_radius_mm, TINY, 1e4),
            ("pitch_mm", self.pitch_mm, TINY, 1e4),
            ("turns", self.turns, TINY, 1000.0),
            ("tooth_length_mm", self.tooth_length_mm, TINY, 1e5),
            ("tooth_pitch_mm", self.tooth_pitch_mm, TINY, 1e5),
            ("size", self.size, 0.2, 3.0),
            ("min_radius_mm", self.min_radius_mm, 0.2, 5.0),
            ("clearance_mm", self.clearance_mm, 0.0, 20.0),
            ("roughness", self.roughness, 0.0, 0.5),
            ("noise_hu", self.noise_hu, 0.0, 1000.0),
            ("blur_mm", self.blur_mm, 0.0, 20.0),
        ]
    }
}

/// Requires `low ≤ value ≤ high`; NaN is refused.
fn within(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), ParamError> {
    let is_legal = (low..=high).contains(&value);
    ParamError::check(key, is_legal, format!("must be from {low} to {high}, is {value}"))
}
