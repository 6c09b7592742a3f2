export const SCENE_ZH: Record<string, string> = {};
