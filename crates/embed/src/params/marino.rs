//! The parameters of the baseline of Marino and Kaufman: `[embed.marino]` in the config.

use espalier_model::diagnose::ParamError;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::choices::MarinoView;

/// The view towards which the radial layout is bent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MarinoParams {
    /// The view. Default `auto`, the best global view; the published method has the user choose one.
    pub view: MarinoView,
    /// The direction towards the camera of `view = "towards"`, RAS+, of any length. Default [0, 1, 0], from the front.
    pub towards_camera: [f64; 3],
    /// What is up in the picture of `view = "towards"`, RAS+, of any length; its part across `towards_camera`
    /// counts. Default [0, 0, 1], cranial.
    pub up: [f64; 3],
    /// The file of `view = "file"`, relative to the config's folder: a `views.json`, whose global view is taken, or JSON
    /// with `towards_camera` and `up` alone. Whoever reads it puts what it says into the two vectors. Default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub view_file: Option<String>,
}

impl Default for MarinoParams {
    fn default() -> Self {
        let (towards_camera, up) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        Self { view: MarinoView::Auto, towards_camera, up, view_file: None }
    }
}

impl MarinoParams {
    /// Unit vectors towards the camera and up, perpendicular to each other.
    pub(crate) fn axes(&self) -> (DVec3, DVec3) {
        let towards_camera = DVec3::from(self.towards_camera).normalize_or_zero();
        let up = DVec3::from(self.up).normalize_or_zero();
        (towards_camera, (up - up.dot(towards_camera) * towards_camera).normalize_or_zero())
    }

    /// Checks that the vectors make a view, and that a file is named where one is read.
    ///
    /// # Errors
    /// The first vector that has no direction, or has that of the other; a file without its view, or a view without its
    /// file.
    pub fn validate(&self) -> Result<(), ParamError> {
        let is_vector = |v: [f64; 3]| (1e-100..=1e100).contains(&DVec3::from(v).length());
        let (towards_camera, up) = (self.towards_camera, self.up);
        let has_file = self.view_file.as_ref().is_some_and(|path| !path.is_empty());
        let is_file = self.view == MarinoView::File;
        let message = "view = \"file\" needs the name of one";
        ParamError::check("marino.view_file", has_file || !is_file, message)?;
        let message = "is read with view = \"file\" only";
        ParamError::check("marino.view_file", is_file || !has_file, message)?;
        let message = format!("must be a vector with a length, is {towards_camera:?}");
        ParamError::check("marino.towards_camera", is_vector(towards_camera), message)?;
        let message = format!("must be a vector with a length, is {up:?}");
        ParamError::check("marino.up", is_vector(up), message)?;
        let units = [towards_camera, up].map(|v| DVec3::from(v).normalize_or_zero());
        let is_across = units[0].cross(units[1]).length() > 1e-6;
        ParamError::check("marino.up", is_across, format!("must not be along towards_camera, is {up:?}"))
    }
}
