//! Present mix of the light groups of a scene: light = sum of factor × map.

use std::{error::Error, fmt};

use bevy::{ecs::prelude::*, math::Vec3, time::Time};

use crate::manifest::States;

/// Light of a loaded scene: its light states and groups.
///
/// The component is on the entity that the scene has spawned below [`SceneRoot`](bevy::scene::SceneRoot), from
/// [`LightmapsReady`](crate::LightmapsReady) on.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_hemibake::LightControl;
/// fn switch(keys: Res<ButtonInput<KeyCode>>, mut scenes: Query<&mut LightControl>) -> Result {
///     for mut light in &mut scenes {
///         if keys.just_pressed(KeyCode::KeyN) {
///             light.set_state("Night", 2.0)?;
///         }
///         if keys.just_pressed(KeyCode::KeyL) {
///             light.set_group("Lamps", LinearRgba::rgb(1.0, 0.8, 0.6), 0.5)?;
///         }
///     }
///     Ok(())
/// }
/// ```
#[derive(Component, Debug, Default)]
pub struct LightControl {
    states: States,
    factors: Vec<(String, Vec3)>,
    fade: Option<Fade>,
    problems: Vec<String>,
}

#[derive(Debug)]
struct Fade {
    before: Vec<Vec3>,
    after: Vec<Vec3>,
    elapsed: f32,
    seconds: f32,
}

/// A light state or group that the file does not have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownName {
    kind: &'static str,
    name: String,
    known: Vec<String>,
}

impl fmt::Display for UnknownName {
    fn fmt(&self, text: &mut fmt::Formatter) -> fmt::Result {
        let known: Vec<_> = self.known.iter().map(|name| format!("'{name}'")).collect();
        let known = if known.is_empty() {
            "none".into()
        } else {
            known.join(", ")
        };
        write!(
            text,
            "{} '{}': not in the file. Choose one of: {known}.",
            self.kind, self.name
        )
    }
}

impl Error for UnknownName {}

impl LightControl {
    /// Shows all light groups with the factor 1.
    ///
    /// Adds messages on groups that states name and the file does not have to `problems`.
    pub(crate) fn new(groups: Vec<String>, states: States, mut problems: Vec<String>) -> Self {
        for (state, factors) in &states.0 {
            let missing = factors
                .keys()
                .filter(|name| !groups.iter().any(|group| group == name));
            problems.extend(missing.map(|name| {
                format!(
                    "State '{state}': no light group '{name}'. Rename it in Blender, or bake it and export again."
                )
            }));
        }
        let factors = groups.into_iter().map(|name| (name, Vec3::ONE)).collect();
        Self {
            states,
            factors,
            fade: None,
            problems,
        }
    }

    /// Returns the names of the light states.
    pub fn states(&self) -> impl Iterator<Item = &str> {
        self.states.keys()
    }

    /// Returns the light groups, and the present factor of each, linear RGB.
    pub fn groups(&self) -> impl Iterator<Item = (&str, Vec3)> {
        self.factors
            .iter()
            .map(|(name, factor)| (name.as_str(), *factor))
    }

    /// Returns the present factor of a light group; 1 for other names.
    pub fn factor(&self, group: &str) -> Vec3 {
        let known = self.factors.iter().find(|(name, _)| name == group);
        known.map_or(Vec3::ONE, |(_, factor)| *factor)
    }

    /// Returns messages on missing files, an unknown version of the manifest, and groups that a state names and the
    /// file does not have. All else is displayed.
    pub fn problems(&self) -> &[String] {
        &self.problems
    }

    /// Returns true during a fade.
    pub fn is_fading(&self) -> bool {
        self.fade.is_some()
    }

    /// Changes to a light state within seconds; at once for 0. A fade ends early if another change follows.
    ///
    /// Groups that the state leaves out get the factor 1.
    pub fn set_state(&mut self, name: &str, seconds: f32) -> Result<(), UnknownName> {
        let Some(state) = self.states.get(name) else {
            let known = self.states.keys().map(String::from).collect();
            return Err(UnknownName {
                kind: "Light state",
                name: name.into(),
                known,
            });
        };
        let groups = self.factors.iter();
        let after = groups.map(|(group, _)| {
            state
                .get(group)
                .map_or(Vec3::ONE, |factor| Vec3::from(*factor))
        });
        let after = after.collect();
        let before = self.factors.iter().map(|(_, factor)| *factor).collect();
        self.fade = Some(Fade {
            before,
            after,
            elapsed: 0.0,
            seconds: seconds.max(0.0),
        });
        self.advance(0.0);
        Ok(())
    }

    /// Sets the color, linear, and the strength of a light group.
    pub fn set_group(
        &mut self,
        name: &str,
        color: impl Into<bevy::color::LinearRgba>,
        strength: f32,
    ) -> Result<(), UnknownName> {
        let Some(entry) = self.factors.iter_mut().find(|(group, _)| group == name) else {
            let known = self
                .factors
                .iter()
                .map(|(group, _)| group.clone())
                .collect();
            return Err(UnknownName {
                kind: "Light group",
                name: name.into(),
                known,
            });
        };
        let color = color.into();
        entry.1 = strength * Vec3::new(color.red, color.green, color.blue);
        self.fade = None;
        Ok(())
    }

    /// Moves a fade on by some seconds.
    pub(crate) fn advance(&mut self, seconds: f32) {
        let Some(fade) = &mut self.fade else { return };
        fade.elapsed += seconds;
        let part = if fade.elapsed < fade.seconds {
            fade.elapsed / fade.seconds
        } else {
            1.0
        };
        for (i, (_, factor)) in self.factors.iter_mut().enumerate() {
            *factor = (1.0 - part) * fade.before[i] + part * fade.after[i];
        }
        if part == 1.0 {
            self.fade = None;
        }
    }
}

/// System that moves all fades on.
pub(crate) fn advance_fades(time: Res<Time>, mut scenes: Query<&mut LightControl>) {
    for mut light in &mut scenes {
        if light.is_fading() {
            light.advance(time.delta_secs());
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::color::LinearRgba;

    use super::*;

    fn control() -> LightControl {
        let states = serde_json::from_str(
            r#"{"Night": {"Lamps": [1, 0.5, 0.25], "Sun": [0, 0, 0]}, "Dusk": {"Sun": [3, 2, 1]}, "Day": {}}"#,
        );
        LightControl::new(
            vec!["Lamps".into(), "Sun".into()],
            states.unwrap(),
            Vec::new(),
        )
    }

    #[test]
    fn a_state_sets_the_factors_of_all_groups() {
        let mut light = control();
        light.set_state("Night", 0.0).unwrap();
        assert_eq!(light.factor("Lamps"), Vec3::new(1.0, 0.5, 0.25));
        assert_eq!(light.factor("Sun"), Vec3::ZERO);
        light.set_state("Dusk", 0.0).unwrap();
        assert_eq!(
            light.factor("Lamps"),
            Vec3::ONE,
            "Dusk leaves the lamps out"
        );
        assert_eq!(light.factor("Sun"), Vec3::new(3.0, 2.0, 1.0));
    }

    #[test]
    fn a_fade_is_linear_and_ends_exactly() {
        let mut light = control();
        light.set_state("Night", 2.0).unwrap();
        assert!(light.is_fading());
        assert_eq!(light.factor("Sun"), Vec3::ONE);
        light.advance(0.5);
        assert_eq!(light.factor("Sun"), Vec3::splat(0.75));
        light.advance(1.75);
        assert!(!light.is_fading());
        assert_eq!(light.factor("Sun"), Vec3::ZERO);
        light.advance(1.0);
        assert_eq!(light.factor("Lamps"), Vec3::new(1.0, 0.5, 0.25));
    }

    #[test]
    fn another_change_ends_a_fade() {
        let mut light = control();
        light.set_state("Night", 2.0).unwrap();
        light.advance(1.0);
        light
            .set_group("Lamps", LinearRgba::rgb(1.0, 0.5, 0.0), 4.0)
            .unwrap();
        light.advance(1.0);
        assert_eq!(light.factor("Lamps"), Vec3::new(4.0, 2.0, 0.0));
        assert_eq!(light.factor("Sun"), Vec3::splat(0.5));
    }

    #[test]
    fn unknown_names_are_named_and_change_nothing() {
        let mut light = control();
        light.set_state("Night", 2.0).unwrap();
        let error = light.set_state("Noon", 0.0).unwrap_err().to_string();
        assert_eq!(
            error,
            "Light state 'Noon': not in the file. Choose one of: 'Night', 'Dusk', 'Day'."
        );
        let error = light
            .set_group("Fire", LinearRgba::WHITE, 1.0)
            .unwrap_err()
            .to_string();
        assert_eq!(
            error,
            "Light group 'Fire': not in the file. Choose one of: 'Lamps', 'Sun'."
        );
        assert!(light.is_fading());
        let error = LightControl::default()
            .set_state("Noon", 0.0)
            .unwrap_err()
            .to_string();
        assert!(error.ends_with("Choose one of: none."));
    }

    #[test]
    fn a_state_with_a_missing_group_is_a_problem_and_works() {
        let light = control();
        let mut light = LightControl::new(
            vec!["Sun".into()],
            light.states,
            vec!["a.exr: not readable.".into()],
        );
        let wanted = [
            "a.exr: not readable.",
            "State 'Night': no light group 'Lamps'. Rename it in Blender, or bake it and export again.",
        ];
        assert_eq!(light.problems(), wanted);
        light.set_state("Night", 0.0).unwrap();
        assert_eq!(light.factor("Sun"), Vec3::ZERO);
    }
}
