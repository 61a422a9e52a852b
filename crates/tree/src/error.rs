//! Why no tree could be made.

use espalier_model::diagnose::{Class, ParamError};
use espalier_model::{Diagnose, TreeError};
use glam::DVec3;
use thiserror::Error;

/// Why no tree could be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// The skeleton has no voxel.
    #[error(
        "the skeleton is empty: a mask of {n_foreground} foreground voxels left nothing to build a tree of"
    )]
    EmptySkeleton {
        /// Foreground voxels of the mask.
        n_foreground: usize,
    },
    /// The traced structure has no node.
    #[error("the traced structure has no node")]
    EmptyTrace,
    /// Spheres and voxels do not belong together.
    #[error("{n_spheres} inscribed spheres for {n_voxels} skeleton voxels")]
    SphereCount {
        /// Voxels of the skeleton.
        n_voxels: usize,
        /// Spheres given.
        n_spheres: usize,
    },
    /// A sphere that cannot be.
    #[error("the sphere of skeleton voxel {voxel} has centre {center_mm} mm and radius {radius_mm} mm")]
    BadSphere {
        /// The voxel's index in the skeleton.
        voxel: usize,
        /// Its centre.
        center_mm: DVec3,
        /// Its radius.
        radius_mm: f64,
    },
    /// Mask and skeleton lie on different grids.
    #[error(
        "the mask has {mask:?} voxels, the skeleton's grid {skeleton:?}, or they lie elsewhere in the world"
    )]
    Grids {
        /// Voxels of the mask along x, y, z.
        mask: [usize; 3],
        /// Voxels of the skeleton's grid along x, y, z.
        skeleton: [usize; 3],
    },
    /// More than one component, refused by policy.
    #[error(
        "the skeleton has {n_components} components; the second largest is {second_mm:.1} mm long, near {position_mm:.1} mm"
    )]
    Components {
        /// How many.
        n_components: usize,
        /// Length of the second largest.
        second_mm: f64,
        /// A place on it, RAS+ mm.
        position_mm: DVec3,
    },
    /// Loops, refused by policy.
    #[error(
        "the skeleton has {n_loops} loops; the thinnest place on the first is at {position_mm:.1} mm with radius {radius_mm:.2} mm"
    )]
    Loops {
        /// How many.
        n_loops: usize,
        /// Where the first would be cut, RAS+ mm.
        position_mm: DVec3,
        /// The radius there.
        radius_mm: f64,
    },
    /// More than one root in a traced structure, refused by policy.
    #[error(
        "{n_roots} roots; the first is node {first_id} on line {first_line}, the second node {second_id} on line {second_line}"
    )]
    Roots {
        /// How many.
        n_roots: usize,
        /// Id of the first root.
        first_id: i64,
        /// Its line.
        first_line: usize,
        /// Id of the second root.
        second_id: i64,
        /// Its line.
        second_line: usize,
    },
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The nodes are not a tree; from [`crate::from_traced`] only for a structure that breaks its guarantees.
    #[error(transparent)]
    Tree(#[from] TreeError),
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::EmptySkeleton { .. } => "E-TREE-NO-SKELETON",
            Self::EmptyTrace => "E-TREE-NO-NODES",
            Self::SphereCount { .. } => "E-TREE-SPHERES",
            Self::BadSphere { .. } => "E-TREE-SPHERE",
            Self::Grids { .. } => "E-TREE-GRIDS",
            Self::Components { .. } => "E-TREE-COMPONENTS",
            Self::Loops { .. } => "E-TREE-LOOPS",
            Self::Roots { .. } => "E-TREE-SEVERAL-ROOTS",
            Self::Param(error) => error.code(),
            Self::Tree(error) => error.code(),
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::EmptySkeleton { .. } | Self::EmptyTrace => Class::Input,
            Self::SphereCount { .. } | Self::BadSphere { .. } | Self::Grids { .. } => Class::Input,
            Self::Components { .. } | Self::Loops { .. } | Self::Roots { .. } => Class::Topology,
            Self::Param(error) => error.class(),
            Self::Tree(error) => error.class(),
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::EmptySkeleton { .. } => {
                "check the mask; `skeleton.thinning = \"safe\"` never thins a body away".to_owned()
            }
            Self::SphereCount { .. } | Self::BadSphere { .. } | Self::Grids { .. } => {
                "run the skeleton and radius stages again on this mask".to_owned()
            }
            Self::Components { .. } => {
                "keep one component of the mask, or set `tree.components = \"largest\"`".to_owned()
            }
            Self::Loops { .. } => {
                "fill the holes of the mask, or set `tree.loops = \"cut\"`: every cut is listed in topology.tsv"
                    .to_owned()
            }
            Self::Roots { .. } => "set `tree.roots = \"largest\"` or `\"join\"`".to_owned(),
            Self::EmptyTrace => String::new(),
            Self::Param(error) => error.hint(),
            Self::Tree(error) => error.hint(),
        }
    }
}
