//! EXR images: one channel of a flat image.

use std::io::Cursor;
use std::path::Path;

use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use exr::prelude::{MetaData, ReadChannels, ReadLayers, ReadSpecificChannel, Text, Vec2, read};

use super::raster::{Raster, check_size};
use crate::error::IoError;
use crate::limits::ReadLimits;

/// The names of channels with depth, in lower case. The first that a file has counts.
const NAMES: [&str; 5] = ["z", "depth", "v", "y", "r"];

/// Decodes the channel of depth, or the only channel.
///
/// A channel `Z` or `depth` without a layer comes first, then those of a layer with "depth" in its
/// name. Colors count if red, green and blue are equal. Vectors, such as normals, do not count.
pub(super) fn decode(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Raster, IoError> {
    let failed = |error: exr::error::Error| {
        let found = "data that are not a complete EXR image";
        IoError::new(path, None, found, "an EXR image without deep data").with_source(error)
    };
    let meta = MetaData::read_from_buffered(Cursor::new(content), false).map_err(failed)?;
    let names = meta.headers.iter().flat_map(|header| {
        let channels = header.channels.list.iter();
        channels.map(move |channel| (header, &channel.name))
    });
    let names: Vec<_> = names.collect();
    let Some((header, name)) = depth_channel(&names) else {
        let shown = names.iter().take(8).map(|(_, name)| format!("{name:?}"));
        let found = format!("the channels {}", shown.collect::<Vec<_>>().join(", "));
        let expected = "one channel `Z` or `depth`, or a single channel";
        return Err(IoError::new(path, None, found, expected));
    };
    let (width, height) = (header.layer_size.x() as u64, header.layer_size.y() as u64);
    // The crate divides by the size of a tile, and counts with it before it checks anything.
    if let BlockDescription::Tiles(tiles) = header.blocks
        && tiles.tile_size.area() == 0
    {
        let found = format!("tiles of {:?} pixels", tiles.tile_size);
        return Err(IoError::new(path, None, found, "tiles with an area"));
    }
    let pixel_bytes = 2 * header.channels.list.len() as u64;
    let raw = width.saturating_mul(height).saturating_mul(pixel_bytes);
    let available = content.len() as u64;
    let size = check_size(limits, (path, 0), (width, height), raw, available)?;
    let samples = |channel: &Text| {
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .specific_channels()
            .required(channel.clone())
            .collect_pixels(
                |size: Vec2<usize>, _| (size.x(), vec![0.0; size.area()]),
                |(width, samples), at, (sample,): (f32,)| {
                    samples[at.y() * *width + at.x()] = sample;
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(content))
            .map_err(failed)?;
        Ok(image.layer_data.channel_data.pixels.1)
    };
    let depth = samples(name)?;
    for (_, other) in names.iter().filter(|(_, other)| is_color_of(name, other)) {
        let other_samples: Vec<f32> = samples(other)?;
        let mut both = depth.iter().zip(&other_samples);
        if both.any(|(a, b)| a.to_bits() != b.to_bits()) {
            let found = format!("colors in the channels {name:?} and {other:?}");
            return Err(IoError::new(
                path,
                None,
                found,
                "a depth image with a channel `Z`",
            ));
        }
    }
    let is_integer = |channel: &ChannelDescription| {
        channel.name == *name && channel.sample_type == SampleType::U32
    };
    let is_integer = header.channels.list.iter().any(is_integer);
    Ok(Raster::gray(size, is_integer.then_some(32), depth))
}

/// Returns the layer and the last part of the name of a channel, in lower case.
///
/// Layers of a renderer come before the last dot: "ViewLayer.Depth.Z".
fn parts(name: &Text) -> (String, String) {
    let name = name.to_string().to_lowercase();
    let (layer, last) = name.rsplit_once('.').unwrap_or(("", &name));
    (layer.to_owned(), last.to_owned())
}

/// Returns the channel with depth, or the only channel, or `None` if several are alike.
fn depth_channel<'a>(names: &[(&'a Header, &'a Text)]) -> Option<(&'a Header, &'a Text)> {
    let all: Vec<_> = names.iter().map(|(_, name)| parts(name)).collect();
    let rank = |(layer, last): &(String, String)| {
        let kind = NAMES.iter().position(|name| name == last)?;
        let is_vector = !layer.is_empty() && all.contains(&(layer.clone(), "x".to_owned()));
        let class = match &**layer {
            "" if kind < 2 => 0,
            layer if layer.contains("depth") => 1,
            _ => 2,
        };
        (!is_vector).then_some((class, kind))
    };
    let ranks: Vec<_> = all.iter().map(rank).collect();
    let Some(best) = ranks.iter().flatten().min() else {
        return names.first().filter(|_| names.len() == 1).copied();
    };
    let ranked = names.iter().zip(&ranks);
    let mut chosen = ranked.filter(|(_, rank)| rank.as_ref() == Some(best));
    match (chosen.next(), chosen.next()) {
        (Some((channel, _)), None) => Some(*channel),
        _ => None,
    }
}

/// Returns whether a channel is the green or blue one of a red one.
fn is_color_of(red: &Text, other: &Text) -> bool {
    let ((layer, last), (other_layer, other)) = (parts(red), parts(other));
    last == "r" && layer == other_layer && matches!(&*other, "g" | "b")
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage};

    #[test]
    fn unsigned_integers_have_a_unit() {
        let channel = AnyChannel::new("Z", FlatSamples::U32(vec![700; 2]));
        let mut bytes = Cursor::new(Vec::new());
        let image =
            Image::from_channels((2, 1), AnyChannels::sort([channel].into_iter().collect()));
        image.write().to_buffered(&mut bytes).unwrap();
        let raster = decode(&ReadLimits::DEFAULT, Path::new("a.exr"), bytes.get_ref());
        let raster = raster.unwrap();
        assert_eq!((raster.integer_bits, raster.samples[0]), (Some(32), 700.0));
    }

    /// Decodes an image of 2x1 pixels, whose channels have the depths 1, 2 and so on.
    fn read(names: &[&str], equal: bool) -> Result<f32, String> {
        let channels = (1_u8..).zip(names).map(|(number, name)| {
            let value = f32::from(if equal { 7 } else { number });
            AnyChannel::new(*name, FlatSamples::F32(vec![value; 2]))
        });
        let channels = AnyChannels::sort(channels.collect());
        let mut bytes = Cursor::new(Vec::new());
        let image = Image::from_channels((2, 1), channels);
        image.write().to_buffered(&mut bytes).unwrap();
        let raster = decode(&ReadLimits::DEFAULT, Path::new("a.exr"), bytes.get_ref());
        raster
            .map(|raster| raster.samples[0])
            .map_err(|error| error.to_string())
    }

    #[test]
    fn the_channel_of_depth_is_found_among_those_of_a_renderer() {
        for (names, expected) in [
            (&["A"][..], 1.0),
            (&["Z"], 1.0),
            (&["N.X", "N.Y", "N.Z", "R", "G", "B", "A", "Z"], 8.0),
            (&["P.X", "P.Y", "P.Z", "depth"], 4.0),
            (
                &[
                    "ViewLayer.Normal.X",
                    "ViewLayer.Normal.Z",
                    "ViewLayer.Depth.V",
                ],
                3.0,
            ),
            (
                &[
                    "Combined.R",
                    "Combined.G",
                    "Combined.B",
                    "ViewLayer.Depth.Z",
                ],
                4.0,
            ),
            (&["R", "G", "B", "V"], 4.0),
        ] {
            assert_eq!(read(names, false), Ok(expected), "{names:?}");
        }
        assert_eq!(read(&["R", "G", "B"], true), Ok(7.0));
    }

    #[test]
    fn colors_vectors_and_several_depths_are_refused() {
        for (names, found) in [
            (&["R", "G", "B"][..], "colors in the channels"),
            (&["N.X", "N.Y", "N.Z"], "the channels"),
            (&["A.Z", "B.Z"], "the channels"),
        ] {
            let error = read(names, false).unwrap_err();
            assert!(error.contains(found) && error.contains("`Z`"), "{error}");
        }
    }
}
