//! The figure as SVG: the trees of all panels, each path with the panel's number before its id, then the marks.

use std::fmt::Write as _;

use espalier_model::xml::escape;

use super::{Artist, Sheet};
use crate::palette::hex;
use crate::svg;

impl Artist<'_> {
    pub(super) fn svg(&self, sheet: &Sheet<'_>, height: u32) -> String {
        let (width, title) =
            (self.params.width_px, self.params.title.as_deref().unwrap_or("methods side by side"));
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
             xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" data-format=\"espalier-compare-svg\" data-version=\"1\">\n\
             <title>{}</title>\n<rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
            escape(title),
            hex(self.colors.background)
        );
        for (panel_idx, frame) in sheet.frames.iter().enumerate() {
            let prefix = format!("panel-{panel_idx}-");
            let content = svg::Content {
                tree: frame.tree,
                branches: &frame.branches,
                scene: &frame.scene,
                coloring: &frame.coloring,
                title,
                prefix: &prefix,
            };
            svg::tree(&mut out, &content, &frame.page, &self.colors);
        }
        svg::write_groups(&mut out, &sheet.groups);
        out.push_str("</svg>\n");
        out
    }
}
